"""Problems: every error that the service answers with, and the table of exceptions."""

import errno
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from geodesic_core import errors as core

PROBLEM_JSON = "application/problem+json"


@dataclass(frozen=True)
class Code:
    """One row of the error table, which ``GET /problems/{code}`` explains."""

    status: int
    title: str
    meaning: str
    chapter: str
    """Of the documents, which tells more, as ``geodesic docs`` takes it"""
    other_statuses: Sequence[int] = ()
    """Further statuses; ``meaning`` says when"""

    @property
    def statuses(self) -> Sequence[int]:
        """All statuses that the code may have."""
        return (self.status, *self.other_statuses)


CODES: Mapping[str, Code] = {
    "malformed_body": Code(
        400,
        "Malformed body",
        "The body is not valid for its media type, for example broken JSON.",
        "http",
    ),
    "idempotency_key_unused": Code(
        400,
        "Idempotency key unused",
        "`Idempotency-Key` names a job, and this request makes none; send it together with "
        "`Prefer: respond-async`, or leave it out.",
        "http#jobs",
    ),
    "malformed_request": Code(
        400,
        "Malformed request",
        "The bytes received are not a valid HTTP request.",
        "operations#access",
    ),
    "unauthorized": Code(
        401, "Unauthorized", "The request has no API key, or a wrong one.", "operations#access"
    ),
    "origin_not_allowed": Code(
        403,
        "Origin not allowed",
        "Pages of other sites may not make changes here; see `hint`.",
        "operations#access",
    ),
    "not_found": Code(404, "Not found", "There is nothing at this address.", "http"),
    "mesh_not_found": Code(
        404, "Mesh not found", "No mesh with this id is in the store.", "operations#the-store"
    ),
    "job_not_found": Code(404, "Job not found", "No job with this id is known.", "http#jobs"),
    "method_not_allowed": Code(
        405,
        "Method not allowed",
        "The address does not support this HTTP method; see `Allow`.",
        "http",
    ),
    "not_acceptable": Code(
        406,
        "Not acceptable",
        "The answer is not available in any of the accepted formats.",
        "http#formats",
    ),
    "job_not_finished": Code(
        409, "Job not finished", "The job has no result yet; try again.", "http#jobs"
    ),
    "job_dismissed": Code(
        410, "Job dismissed", "The job was cancelled and has no result.", "http#jobs"
    ),
    "upload_too_large": Code(
        413,
        "Body too large",
        "The body of the request is larger than the service accepts.",
        "operations#settings",
    ),
    "result_too_large": Code(
        413,
        "Result too large",
        "The answer is too large for this format; see `hint`.",
        "http#formats",
    ),
    "unsupported_media_type": Code(
        415,
        "Unsupported media type",
        "The service cannot read the format of the body.",
        "reference/files",
    ),
    "range_not_satisfiable": Code(
        416,
        "Range not satisfiable",
        "The requested range lies outside the content.",
        "matrices#on-a-service-and-on-several-machines",
    ),
    "host_not_allowed": Code(
        421,
        "Host not allowed",
        "The service does not accept requests for this host name; see `hint`.",
        "operations#access",
    ),
    "invalid_request": Code(
        422,
        "Invalid request",
        "A field is missing, unknown, or outside its domain; see `errors`.",
        "http",
    ),
    "invalid_mesh": Code(
        422,
        "Invalid mesh",
        "The mesh cannot be used; `errors` names the faulty elements.",
        "accuracy#imperfect-meshes",
    ),
    "invalid_point": Code(
        422, "Invalid point", "A source or target is not a point of the mesh.", "http#points"
    ),
    "not_embedded": Code(
        422,
        "Not embedded",
        "The mesh is given by the lengths of its edges, and the query needs positions in space: "
        "upload it with vertices, or ask for angles in place of vectors.",
        "http#surfaces-by-lengths",
    ),
    "limit_exceeded": Code(
        422,
        "Limit exceeded",
        "The request exceeds a limit of this service; see `setting` or `hint`.",
        "operations#settings",
    ),
    "memory_limit": Code(
        422,
        "Memory limit",
        "The query needs more memory than the service grants to one query.",
        "operations#workers",
    ),
    "rate_limited": Code(
        429, "Rate limited", "Too many requests; see `Retry-After`.", "operations#access"
    ),
    "quota_exceeded": Code(
        429,
        "Quota exceeded",
        "The caller has reached the quota that `setting` names. The status is 429 for jobs and for "
        "uploads under way (see `Retry-After`), and 507 for stored meshes and for answers to jobs "
        "(see `hint`).",
        "operations#access",
        other_statuses=(507,),
    ),
    "header_too_large": Code(
        431,
        "Header too large",
        "The request line and the headers are too large.",
        "operations#access",
    ),
    "internal_error": Code(
        500,
        "Internal error",
        "A defect of the service; please report it with the request id.",
        "operations#log",
    ),
    "worker_died": Code(
        500,
        "Worker died",
        "The process that computed the answer died; it has been replaced.",
        "operations#faults",
    ),
    "mesh_damaged": Code(
        500,
        "Mesh damaged",
        "The stored files of this mesh are damaged; upload the mesh again.",
        "operations#the-store",
    ),
    "queue_full": Code(
        503,
        "Queue full",
        "Too many requests wait for a worker, or too many uploads are under way; see "
        "`Retry-After`.",
        "operations#workers",
    ),
    "too_many_connections": Code(
        503,
        "Too many connections",
        "The service has too many open connections; try again.",
        "operations#access",
    ),
    "engine_unavailable": Code(
        503,
        "Engine unavailable",
        "No worker process can be started at the moment.",
        "operations#faults",
    ),
    "state_unavailable": Code(
        503,
        "State unavailable",
        "The database of jobs and quotas does not answer; see `Retry-After`. The request may or "
        "may not have made its change: repeat it with the same `Idempotency-Key`.",
        "operations#faults",
    ),
    "store_unavailable": Code(
        503,
        "Store unavailable",
        "The object store of meshes and answers does not answer; see `Retry-After`. It is safe to "
        "repeat an upload: its mesh is stored once.",
        "operations#faults",
    ),
    "draining": Code(503, "Draining", "The service is shutting down.", "operations#faults"),
    "deadline_exceeded": Code(
        504,
        "Deadline exceeded",
        "The answer was not ready within the time limit.",
        "operations#faults",
    ),
    "storage_full": Code(
        507,
        "Storage full",
        "The store has no room left, or its disk is read-only.",
        "operations#the-store",
    ),
}


@dataclass(frozen=True)
class Fault:
    """A faulty element of the request, by JSON pointer, with a message."""

    pointer: str
    message: str


@dataclass(frozen=True)
class Problem:
    """An error as a value, which a worker process can send."""

    code: str
    detail: str
    errors: tuple[Fault, ...] = ()
    limit: int | float | None = None
    actual: int | float | None = None
    setting: str | None = None
    hint: str | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    other_status: int | None = None
    """One of the code's ``other_statuses``, where it applies"""

    @property
    def status(self) -> int:
        """The HTTP status."""
        return self.other_status or CODES[self.code].status

    def document(self, instance: str, request_id: str, prefix: str) -> dict[str, Any]:
        """Return the body of the response (RFC 9457), without members that have no value.

        ``prefix`` is that of the addresses of the service.
        """
        members = {
            "type": f"{prefix}/problems/{self.code}",
            "title": CODES[self.code].title,
            "status": self.status,
            "detail": self.detail,
            "instance": instance,
            "code": self.code,
            "request_id": request_id,
            "errors": [vars(fault) for fault in self.errors] or None,
            "limit": self.limit,
            "actual": self.actual,
            "setting": self.setting,
            "hint": self.hint,
        }
        return {name: value for name, value in members.items() if value is not None}


class ProblemError(Exception):
    """The exception that carries a problem to the client."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.detail)
        self.problem = problem


class StateUnavailableError(OSError):
    """The database that replicas share does not answer at the moment."""


class StoreUnavailableError(OSError):
    """The object store of the service does not answer at the moment."""


def draining() -> ProblemError:
    """Return the exception for a request that the end of the service refuses or cuts off."""
    return problem("draining", "the service is about to stop", headers={"Retry-After": "1"})


def problem(code: str, detail: str, **members: Any) -> ProblemError:
    """Return the exception for a problem with these members."""
    return ProblemError(Problem(code, detail, **members))


def over_limit(
    code: str, what: str, actual: int, limit: int, setting: str, **members: Any
) -> ProblemError:
    """Return the exception for ``actual`` elements where ``setting`` allows ``limit``.

    Parameters
    ----------
    code
        Code of the problem.
    what
        Name of the elements, plural.
    actual, limit
        The number of elements, and the largest number allowed.
    setting
        The setting that has the limit, such as ``max_faces``.
    members
        Further members of the problem.
    """
    detail = f"{actual} {what}; at most {limit} are allowed"
    return problem(code, detail, limit=limit, actual=actual, setting=setting, **members)


def too_large_unpacked(limit: int, max_bytes: int) -> ProblemError:
    """Return the exception for a packed file that has more than ``limit`` bytes when unpacked.

    Where that is less than ``max_bytes``, the file grows more than a mesh does.
    """
    if limit == max_bytes:
        detail = f"the file is larger than {limit} bytes when unpacked"
        return problem("upload_too_large", detail, limit=limit, setting="max_upload_bytes")
    detail = f"the file is packed too tightly: it is larger than {limit} bytes when unpacked"
    return problem("upload_too_large", detail, limit=limit, hint="send it without compression")


def pointer(*parts: str | int) -> str:
    """Return the JSON pointer (RFC 6901) of a place in the body."""
    return "".join("/" + str(part).replace("~", "~0").replace("/", "~1") for part in parts)


_ARRAY_OF = {"vertex": "vertices", "face": "faces", "edge": "edges"}


def _mesh_faults(error: core.InvalidMesh) -> Sequence[Fault]:
    array = _ARRAY_OF.get(error.kind)
    if array is None:
        return ()
    faults = []
    for element in error.elements:
        index = "-".join(map(str, element)) if isinstance(element, tuple) else element
        faults.append(Fault(pointer(array, index), f"{error.kind} {index} is faulty"))
    return faults


def _invalid_mesh(error: core.InvalidMesh) -> Problem:
    return Problem("invalid_mesh", str(error), errors=tuple(_mesh_faults(error)))


def _too_many_faces(error: core.TooManyFaces) -> Problem:
    return over_limit("limit_exceeded", "faces", error.faces, error.max_faces, "max_faces").problem


def _too_many_vertices(error: core.TooManyVertices) -> Problem:
    counts = error.vertices, error.max_vertices
    return over_limit("limit_exceeded", "vertices", *counts, "max_vertices").problem


def _unknown_file_type(error: core.UnknownFileType) -> Problem:
    hint = "name the format by ?format=, by Content-Type, or by the suffix of the file's name"
    return Problem("unsupported_media_type", str(error), hint=hint)


def _over_memory(error: core.MemoryLimitExceeded) -> Problem:
    what, limit = "bytes or more are needed", error.memory_limit
    return over_limit("memory_limit", what, error.needed, limit, "query_memory_bytes").problem


def _system_error(error: OSError) -> Problem:
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return _DISK_FULL
    if error.errno == errno.EROFS:
        return _READ_ONLY
    return (
        _NO_DESCRIPTORS if error.errno in (errno.EMFILE, errno.ENFILE) else _internal_error(error)
    )


_DISK_FULL = Problem("storage_full", "the store has no room left on its disk")
_READ_ONLY = Problem("storage_full", "the disk of the store is read-only at the moment")
_NO_DESCRIPTORS = Problem(
    "too_many_connections",
    "the service has too many files and connections open",
    headers={"Retry-After": "1"},
)


_NO_STATE = Problem(
    "state_unavailable",
    "the database of the service does not answer",
    headers={"Retry-After": "1"},
)


_NO_STORE = Problem(
    "store_unavailable",
    "the object store of the service does not answer",
    headers={"Retry-After": "1"},
)


def _internal_error(_error: BaseException) -> Problem:
    return Problem("internal_error", "the service failed on this request; its log has the reason")


# The first row whose type matches is used.
EXCEPTIONS: Sequence[tuple[type[BaseException], Callable[[Any], Problem]]] = (
    (ProblemError, lambda error: error.problem),
    (core.TooManyFaces, _too_many_faces),
    (core.TooManyVertices, _too_many_vertices),
    (core.UnknownFileType, _unknown_file_type),
    (core.MissingExtra, lambda error: Problem("unsupported_media_type", str(error))),
    (core.InvalidMesh, _invalid_mesh),
    (core.InvalidPoint, lambda error: Problem("invalid_point", str(error))),
    (core.NotEmbedded, lambda error: Problem("not_embedded", str(error))),
    (core.InvalidArgument, lambda error: Problem("invalid_request", str(error))),
    (core.DeadlineExceeded, lambda error: Problem("deadline_exceeded", str(error))),
    (core.MemoryLimitExceeded, _over_memory),
    (core.InternalError, lambda error: Problem("internal_error", str(error))),
    (MemoryError, lambda _: Problem("memory_limit", "the worker ran out of memory")),
    (StateUnavailableError, lambda _: _NO_STATE),
    (StoreUnavailableError, lambda _: _NO_STORE),
    (OSError, _system_error),
    (BaseException, _internal_error),
)


def problem_of(error: BaseException) -> Problem:
    """Return the problem for an exception."""
    return next(make(error) for kind, make in EXCEPTIONS if isinstance(error, kind))


_CODE_OF_STATUS = {
    404: "not_found",
    405: "method_not_allowed",
    413: "upload_too_large",
    416: "range_not_satisfiable",
    500: "internal_error",
}


def problem_of_status(
    status: int, detail: str, headers: Mapping[str, str] | None = None
) -> Problem:
    """Return the problem for an error that the web framework raised."""
    code = _CODE_OF_STATUS.get(status, "malformed_body")
    return Problem(code, detail or CODES[code].meaning, headers=headers or {})
