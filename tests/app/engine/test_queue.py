"""Whose turn it is."""

from app.engine.queue import FairQueue


def anything(_: object) -> bool:
    return True


def taken(queue: FairQueue[str]) -> list[str]:
    found = []
    while (item := queue.take(anything)) is not None:
        found.append(item)
    return found


def filled(*items: str) -> FairQueue[str]:
    """Return a queue in which each item waits for the client that its first letter names."""
    queue: FairQueue[str] = FairQueue()
    for item in items:
        queue.put(item[0], item)
    return queue


def test_what_one_client_asks_keeps_its_order() -> None:
    assert taken(filled("a1", "a2", "a3")) == ["a1", "a2", "a3"]


def test_clients_take_turns() -> None:
    assert taken(filled("a1", "a2", "a3", "b1", "c1", "c2")) == ["a1", "b1", "c1", "a2", "c2", "a3"]


def test_a_client_that_comes_later_waits_for_one_turn_of_each_other() -> None:
    queue = filled("a1", "a2", "a3")
    assert queue.take(anything) == "a1"
    queue.put("b", "b1")

    assert taken(queue) == ["a2", "b1", "a3"]


def test_what_does_not_fit_keeps_its_place() -> None:
    queue = filled("a1", "a2", "b1", "b2")

    assert queue.take(lambda item: item.endswith("2")) == "a2"
    assert taken(queue) == ["b1", "a1", "b2"]


def test_nothing_fits() -> None:
    queue = filled("a1")

    assert queue.take(lambda _: False) is None
    assert len(queue) == 1


def test_what_is_removed_is_never_taken() -> None:
    queue = filled("a1", "a2", "b1")
    queue.remove("a", "a1")
    queue.remove("b", "b1")
    queue.remove("b", "b1")

    assert (len(queue), queue.has("a"), queue.has("b")) == (1, True, False)
    assert taken(queue) == ["a2"]


def test_all_are_taken_at_once() -> None:
    queue = filled("a1", "b1", "a2")

    assert sorted(queue.take_all()) == ["a1", "a2", "b1"]
    assert len(queue) == 0
