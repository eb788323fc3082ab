"""Pseudosources: windows that a vertex emits, as a source or where shortest paths bend (3.2)."""

import math

from geodesic_core.kernels.front.directions import lit_from_vertex
from geodesic_core.kernels.front.pruning import may_pass
from geodesic_core.kernels.front.relaxation import incoming_angle
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    LIGHT,
    LIT_FROM,
    LIT_TO,
    PREDECESSOR,
    SENT_AT,
    SENT_FROM,
    SENT_TO,
    WINNER,
    View,
    merging,
    source_weight,
)
from geodesic_core.kernels.front.window import emitted_window
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    BOUNDARY,
    COS_RIGHT,
    FANS,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    NO_FACE,
    OUT_LEFT,
    OUT_RIGHT,
    PINCHED,
    ROW,
    SIN_RIGHT,
    following,
    previous,
)
from geodesic_core.kernels.sweep.delivery import reach_straight, send_out
from geodesic_core.tolerances import FLAT, SECTOR_MARGIN


@kernel
def is_pseudosource(wave: View, v: int) -> bool:
    """Whether shortest paths may bend at v (or start there), within the limit."""
    vertices = wave.vertices
    bends = wave.mesh.flags[v] != 0 or vertices.winner_ints[WINNER * v + ENTRY_EDGE] < 0
    return bends and vertices.distance[v] <= wave.bounds.max_distance and may_pass(wave, v)


@kernel
def emit_pseudosource(wave: View, v: int) -> None:
    """Emit windows from v: all around a source, else into the shadow behind v.

    At a saddle no straight path through a neighbourhood of v reaches the shadow: the directions
    that make an angle of π or more with the incoming one on both sides. At a boundary one side is
    enough. Where several fans meet, or faces are pinched, v emits all around. Modifies the lists
    across the faces at v, and its neighbours.
    """
    mesh, vertices = wave.mesh, wave.vertices
    total = mesh.total_angle[v]
    if vertices.winner_ints[WINNER * v + ENTRY_EDGE] < 0 or mesh.flags[v] & (FANS | PINCHED) != 0:
        emit_around(wave, v)
    elif merging(wave):
        emit_shadows(wave, v)
    else:
        via = vertices.winner_ints[WINNER * v + ENTRY_EDGE]
        weight = source_weight(wave, vertices.winner_ints[WINNER * v + PREDECESSOR])
        lit = incoming_angle(wave, via, vertices.winner[2 * v], vertices.winner[2 * v + 1], weight)
        if mesh.flags[v] & BOUNDARY:
            emit_between(wave, v, lit + math.pi - SECTOR_MARGIN, total)
            emit_between(wave, v, 0.0, lit - math.pi + SECTOR_MARGIN)
        else:
            start, end = lit + math.pi - SECTOR_MARGIN, lit - math.pi + total + SECTOR_MARGIN
            emit_between(wave, v, start, end)


@kernel
def emit_shadows(wave: View, v: int) -> None:
    """Emit into the shadows of all directions that v is lit from, but for those emitted before.

    Modifies the light of v.
    """
    mesh, vertices = wave.mesh, wave.vertices
    row, total = LIGHT * v, mesh.total_angle[v]
    lo, hi = vertices.light[row + LIT_FROM], vertices.light[row + LIT_TO]
    sent_lo, sent_hi = vertices.light[row + SENT_FROM], vertices.light[row + SENT_TO]
    anew = vertices.distance[v] < vertices.light[row + SENT_AT] or lo > sent_lo or hi < sent_hi
    vertices.light[row + SENT_FROM], vertices.light[row + SENT_TO] = lo, hi
    vertices.light[row + SENT_AT] = vertices.distance[v]
    behind, before = math.pi - SECTOR_MARGIN, SECTOR_MARGIN - math.pi
    if mesh.flags[v] & BOUNDARY:
        emit_between(wave, v, lo + behind, total if anew else sent_lo + behind)
        emit_between(wave, v, 0.0 if anew else max(sent_hi + before, 0.0), hi + before)
    elif anew:
        emit_between(wave, v, lo + behind, min(hi + before, lo + behind) + total)
    else:
        emit_between(wave, v, lo + behind, sent_lo + behind)
        emit_between(wave, v, sent_hi + before + total, hi + before + total)


@kernel
def emit_around(wave: View, v: int) -> None:
    """Emit into every face at v."""
    mesh = wave.mesh
    for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
        h, widest = mesh.corners[c], corner_end(wave, v, c) - mesh.corner_angles[c]
        emit_sector(wave, v, h, 0.0, widest, widest)
        relax_edge_ahead(wave, v, h)
        if mesh.links[ROW * h + OUT_LEFT] < 0:
            relax_last_edge(wave, v, h)


@kernel
def corner_end(wave: View, v: int, c: int) -> float:
    """Angle at which the corner at c of the corners ends in the unfolded fan of v."""
    mesh = wave.mesh
    end: float = mesh.total_angle[v]
    if c + 1 < mesh.first_corner[v + 1]:
        end = mesh.corner_angles[c + 1]
    return end


@kernel
def emit_between(wave: View, v: int, lo: float, hi: float) -> None:
    """Emit between two angles of the unfolded fan, which at an inner vertex closes to a circle."""
    mesh = wave.mesh
    if hi <= lo:
        return
    around = -1.0  # where a sector that passes the seam of the fan ends; none does yet
    if not mesh.flags[v] & BOUNDARY:
        turn = mesh.total_angle[v]
        turns = math.floor(lo / turn)
        lo, hi = lo - turns * turn, hi - turns * turn
        around = hi - turn
    for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
        h, start, end = mesh.corners[c], mesh.corner_angles[c], corner_end(wave, v, c)
        if lo < end and start < hi:
            emit_sector(wave, v, h, lo - start, hi - start, end - start)
        if start < around:
            emit_sector(wave, v, h, 0.0, around - start, end - start)
        if lo <= start <= hi or start <= around:
            relax_edge_ahead(wave, v, h)
        if end <= hi and mesh.links[ROW * h + OUT_LEFT] < 0:
            relax_last_edge(wave, v, h)


@kernel
def relax_edge_ahead(wave: View, v: int, h: int) -> None:
    """Offer the head of h, which leaves v, the straight path along it."""
    mesh = wave.mesh
    before = previous(h)  # its apex is the head of h, and it ends at v
    reach, place = mesh.geometry[ROW * h + LENGTH], mesh.geometry[ROW * before + LENGTH]
    reach_straight(wave, mesh.links[ROW * h + HEAD], reach, before, place, 0.0, v)


@kernel
def relax_last_edge(wave: View, v: int, h: int) -> None:
    """Offer the path along the last edge of an open fan: from the tail of h to its apex."""
    mesh = wave.mesh
    reach = mesh.geometry[ROW * h + LENGTH_LEFT]
    reach_straight(wave, mesh.links[ROW * h + APEX], reach, h, 0.0, 0.0, v)


@kernel
def emit_sector(wave: View, v: int, h: int, lo: float, hi: float, widest: float) -> None:
    """Emit the window of v that crosses the face of h, its corner at v, between two angles.

    The angles are measured from h; the part outside of the corner is cut off.
    """
    mesh, vertices = wave.mesh, wave.vertices
    if hi <= 0.0 or lo >= widest or hi <= lo:
        return
    row = ROW * h
    across = mesh.links[row + OUT_RIGHT]
    if across == NO_FACE:
        return
    length = mesh.geometry[row + LENGTH_RIGHT]
    b0, b1 = 0.0, length
    # The frame of the half-edge across starts at the apex: distances count from its far end.
    if lo > 0.0:
        b1 = length - along_far_edge(wave, h, lo)
    if hi < widest:
        b0 = length - along_far_edge(wave, h, hi)
    if b1 <= b0:
        return
    sx = length - mesh.geometry[row + COS_RIGHT] * mesh.geometry[row + LENGTH]
    # In a face of no area the apex lies on the edge across, from where no ray would leave.
    sy = min(-mesh.geometry[row + SIN_RIGHT] * mesh.geometry[row + LENGTH], -FLAT * length)
    sigma, xi = vertices.distance[v], 0.0
    if merging(wave):
        xi = vertices.upper[v] - sigma
    window = emitted_window(wave, b0, b1, sx, sy, sigma, v, xi)
    send_out(wave, across, following(h), lit_from_vertex(wave, window, v, h))


@kernel
def along_far_edge(wave: View, h: int, angle: float) -> float:
    """Place on the far edge, from the head of h, of the ray from the tail of h at ``angle``."""
    mesh = wave.mesh
    row = ROW * h
    sine, cosine = math.sin(angle), math.cos(angle)
    far = sine * mesh.geometry[row + COS_RIGHT] + cosine * mesh.geometry[row + SIN_RIGHT]
    reach: float = mesh.geometry[row + LENGTH_RIGHT]
    if far <= 0.0:
        return reach
    place: float = mesh.geometry[row + LENGTH] * sine / far
    return min(place, reach)
