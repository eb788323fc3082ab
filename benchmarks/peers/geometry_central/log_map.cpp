// Exact log map of a point in a face by geometry-central: its MMP, and a path traced back from each vertex.
//
// Reads from standard input, binary: numbers of vertices and faces and the face of the source (int64
// each), its weights (float64, three), positions (float64, three each), corners (int32, three each). Writes to standard output, binary: processor seconds of the
// sweep and of all paths, then two coordinates in the tangent plane for each vertex (float64).

#include "geometrycentral/surface/exact_geodesics.h"
#include "geometrycentral/surface/surface_mesh_factories.h"

#include <cstdint>
#include <ctime>
#include <iostream>

using namespace geometrycentral;
using namespace geometrycentral::surface;

template <typename T> std::vector<T> read(size_t count) {
  std::vector<T> values(count);
  std::cin.read(reinterpret_cast<char*>(values.data()), count * sizeof(T));
  return values;
}

double now() { return double(std::clock()) / CLOCKS_PER_SEC; }

int main() {
  const auto head = read<int64_t>(3);
  const auto weights = read<double>(3);
  const auto numbers = read<double>(3 * head[0]);
  const auto corners = read<int32_t>(3 * head[1]);
  std::vector<Vector3> positions;
  std::vector<std::vector<size_t>> faces;
  for (size_t i = 0; i < numbers.size(); i += 3) {
    positions.push_back({numbers[i], numbers[i + 1], numbers[i + 2]});
  }
  for (size_t i = 0; i < corners.size(); i += 3) {
    faces.push_back({size_t(corners[i]), size_t(corners[i + 1]), size_t(corners[i + 2])});
  }
  auto [mesh, geometry] = makeManifoldSurfaceMeshAndGeometry(faces, positions);

  const double began = now();
  GeodesicAlgorithmExact exact(*mesh, *geometry);
  exact.propagate(SurfacePoint(mesh->face(head[2]), {weights[0], weights[1], weights[2]}));
  const double swept = now();
  std::vector<double> answer{swept - began, 0.0};
  for (Vertex v : mesh->vertices()) {
    const Vector2 log = exact.getLog(v);
    answer.push_back(log.x);
    answer.push_back(log.y);
  }
  answer[1] = now() - swept;
  std::cout.write(reinterpret_cast<const char*>(answer.data()), answer.size() * sizeof(double));
}
