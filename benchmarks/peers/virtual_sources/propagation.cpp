// Geodesic distances by propagation of virtual sources, after the idea of Trettner, Bommes and
// Kobbelt, "Geodesic Distance Computation via Virtual Source Propagation" (2021), for `scripts/bench
// virtual-sources`. Each face keeps one virtual source: a place in its plane from which it seems to
// be lit, and what the way to there has cost. It takes another when that is nearer to its centre.
// Faces wait in the order in which they come, in rounds of one mean edge. A way that passes beside
// the edge bends at that end of it; their heuristic for bends is left out.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace {

struct Point {
  float x, y;
};

Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
float cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }
float length(Point a) { return std::sqrt(a.x * a.x + a.y * a.y); }

/** How a place in the plane of one face is seen in that of the next. */
struct Turn {
  float cosine, sine, x, y;

  Point operator()(Point p) const {
    return {cosine * p.x - sine * p.y + x, sine * p.x + cosine * p.y + y};
  }
};

/** A face in its plane: the first corner is the origin, and the second one is on the x axis. */
struct Face {
  Point second, third;
  Turn turns[3];
  std::int32_t neighbours[3];  // half-edges across: 3 face + edge; -1 at the boundary

  Point corner(int i) const { return i == 0 ? Point{0, 0} : i == 1 ? second : third; }
  Point centre() const { return {(second.x + third.x) / 3, third.y / 3}; }
};

struct State {
  Point source;
  float offset;  // what the way to the source has cost
  float centre;  // the distance of the face's centre
};

struct Surface {
  std::vector<Face> faces;
  std::vector<std::int32_t> corners;
  float round;  // a mean edge
  std::int32_t vertices;
};

struct Wave {
  const Surface& surface;
  std::vector<State> states;
  std::vector<std::uint8_t> waits;
  std::vector<std::int32_t> now, later;

  explicit Wave(const Surface& surface)
      : surface(surface),
        states(surface.faces.size(), {{0, 0}, 0, std::numeric_limits<float>::infinity()}),
        waits(surface.faces.size(), 0) {}

  void offer(std::int32_t face, State state, float limit) {
    if (!(state.centre < states[face].centre)) return;
    states[face] = state;
    if (waits[face]) return;
    waits[face] = 1;
    (state.centre <= limit ? now : later).push_back(face);
  }

  void cross_edge(const Face& from, const State& state, int edge, float limit) {
    const std::int32_t across = from.neighbours[edge];
    if (across < 0) return;
    const std::int32_t next = across / 3;
    const int entry = across % 3;
    const Face& face = surface.faces[next];
    const Point source = from.turns[edge](state.source), centre = face.centre();
    const float straight = state.offset + length(centre - source);
    if (!(straight < states[next].centre)) return;
    const Point tail = face.corner(entry), head = face.corner((entry + 1) % 3);
    const Point ray = centre - source;
    const bool beside_tail = cross(ray, tail - source) < 0, beside_head = cross(ray, head - source) > 0;
    if (!beside_tail && !beside_head) {
      offer(next, {source, state.offset, straight}, limit);
      return;
    }
    const Point bend = beside_tail ? tail : head;
    const float offset = state.offset + length(bend - source);
    offer(next, {bend, offset, offset + length(centre - bend)}, limit);
  }

  void run() {
    float limit = surface.round;
    while (!now.empty() || !later.empty()) {
      for (std::size_t i = 0; i < now.size(); ++i) {
        const std::int32_t face = now[i];
        waits[face] = 0;
        const State state = states[face];
        for (int edge = 0; edge < 3; ++edge) cross_edge(surface.faces[face], state, edge, limit);
      }
      now.clear();
      limit += surface.round;
      std::vector<std::int32_t> still;
      for (const std::int32_t face : later) (states[face].centre <= limit ? now : still).push_back(face);
      later.swap(still);
    }
  }
};

}  // namespace

extern "C" {

/** Prepare a surface: corners of faces, and the half-edge across each, -1 without one. */
Surface* prepare(const double* vertices, std::int32_t count, const std::int32_t* corners,
                 const std::int32_t* opposite, std::int32_t faces) {
  auto* surface = new Surface{std::vector<Face>(faces), {corners, corners + 3 * faces}, 0, count};
  double edges = 0;
  for (std::int32_t f = 0; f < faces; ++f) {
    const auto apart = [&](int i, int j) {
      double sum = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double step = vertices[3 * corners[3 * f + j] + axis] - vertices[3 * corners[3 * f + i] + axis];
        sum += step * step;
      }
      return std::sqrt(sum);
    };
    const double base = apart(0, 1), left = apart(0, 2), right = apart(1, 2);
    const double x = base > 0 ? (base * base + left * left - right * right) / (2 * base) : 0;
    const double y = std::sqrt(std::fmax(0, left * left - x * x));
    surface->faces[f].second = {float(base), 0};
    surface->faces[f].third = {float(x), float(y)};
    edges += base + left + right;
  }
  surface->round = float(edges / (3.0 * faces));
  for (std::int32_t h = 0; h < 3 * faces; ++h) {
    Face& face = surface->faces[h / 3];
    const std::int32_t across = opposite[h];
    face.neighbours[h % 3] = across;
    if (across < 0) continue;
    const Face& next = surface->faces[across / 3];
    const Point tail = face.corner(h % 3), head = face.corner((h % 3 + 1) % 3);
    const Point end = next.corner(across % 3), start = next.corner((across % 3 + 1) % 3);  // of tail, there
    const Point here = head - tail, there = end - start;
    const float square = here.x * here.x + here.y * here.y;
    const float cosine = square > 0 ? (here.x * there.x + here.y * there.y) / square : 1;
    const float sine = square > 0 ? cross(here, there) / square : 0;
    face.turns[h % 3] = {cosine, sine, start.x - (cosine * tail.x - sine * tail.y),
                         start.y - (sine * tail.x + cosine * tail.y)};
  }
  return surface;
}

/** Fill the distances of all vertices from one. */
void distances(const Surface* surface, std::int32_t source, float* found) {
  Wave wave(*surface);
  const auto faces = std::int32_t(surface->faces.size());
  for (std::int32_t f = 0; f < faces; ++f) {
    for (int i = 0; i < 3; ++i) {
      if (surface->corners[3 * f + i] != source) continue;
      const Face& face = surface->faces[f];
      wave.offer(f, {face.corner(i), 0, length(face.centre() - face.corner(i))}, surface->round);
    }
  }
  wave.run();
  std::fill(found, found + surface->vertices, std::numeric_limits<float>::infinity());
  for (std::int32_t f = 0; f < faces; ++f) {
    const State& state = wave.states[f];
    if (!(state.centre < std::numeric_limits<float>::infinity())) continue;
    for (int i = 0; i < 3; ++i) {
      const float distance = state.offset + length(surface->faces[f].corner(i) - state.source);
      float& known = found[surface->corners[3 * f + i]];
      if (distance < known) known = distance;
    }
  }
}

void drop(Surface* surface) { delete surface; }
}
