// Polylines of constant width in pixels, in front of the surface or faint behind it.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  Mesh,
  ShaderMaterial,
  Vector2,
  type WebGLRenderer,
} from "three";

export type Triple = [number, number, number];

// A rectangle of pixels for each segment, slightly in front of it, so that the surface does not cut
// it. All are one mesh: three's own lines draw an instance per segment, which is slow in software.
const VERTEX = /* glsl */ `
  attribute vec3 start;
  attribute vec3 end;
  attribute vec2 corner;
  uniform vec2 resolution;
  uniform float width;
  uniform float before;
  uniform float caps;
  varying vec2 place;
  varying float extent;

  const float NEAR = 0.01;

  // The projection of an end, or of the point where the segment enters from behind the camera.
  vec3 projected(vec4 eye, vec4 other) {
    if (eye.z > -NEAR && other.z < -NEAR) eye = mix(eye, other, (eye.z + NEAR) / (eye.z - other.z));
    vec4 clip = projectionMatrix * eye;
    return clip.xyz / clip.w;
  }

  void main() {
    vec4 first = modelViewMatrix * vec4(start, 1.0);
    vec4 last = modelViewMatrix * vec4(end, 1.0);
    vec3 from = projected(first, last);
    vec3 to = projected(last, first);
    vec2 along = 0.5 * resolution * (to.xy - from.xy);
    extent = length(along);
    along = extent > 0.0 ? along / extent : vec2(1.0, 0.0);
    vec2 away = (0.5 * width + 1.0) * vec2(corner.x * caps, corner.y);
    place = vec2(corner.x < 0.0 ? away.x : extent + away.x, away.y);
    vec3 here = corner.x < 0.0 ? from : to;
    here.xy += 2.0 * (away.x * along + away.y * vec2(-along.y, along.x)) / resolution;
    gl_Position = vec4(here.xy, here.z - before, 1.0);
  }`;

const FRAGMENT = /* glsl */ `
  uniform vec3 colour;
  uniform float opacity;
  uniform float width;
  varying vec2 place;
  varying float extent;
  void main() {
    float away = distance(place, vec2(clamp(place.x, 0.0, extent), 0.0));
    gl_FragColor = vec4(colour, opacity * clamp(0.5 * width - away + 0.5, 0.0, 1.0));
  }`;

export interface Look {
  colour: number;
  /** Pixels. */
  width: number;
  opacity: number;
  /** The offset in depth in front of the surface; null ignores the surface. */
  before: number | null;
  order: number;
}

/** Return a mesh that draws a geometry of `ribbons`. */
export function ribbonMesh({ colour, width, opacity, before, order }: Look): Mesh {
  const resolution = new Vector2();
  const material = new ShaderMaterial({
    uniforms: {
      colour: { value: new Color(colour) },
      opacity: { value: opacity },
      width: { value: width },
      before: { value: before ?? 0 },
      caps: { value: before === null ? 0 : 1 }, // without depth, overlapping caps would add up
      resolution: { value: resolution },
    },
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    transparent: true,
    side: DoubleSide,
    depthTest: before !== null,
    depthWrite: false,
  });
  const line = new Mesh(new BufferGeometry(), material);
  line.renderOrder = order;
  line.frustumCulled = false;
  line.onBeforeRender = (renderer) => {
    (renderer as WebGLRenderer).getDrawingBufferSize(resolution);
    material.uniforms.width!.value = width * renderer.getPixelRatio();
  };
  return line;
}

/** Return four corners for each segment of some polylines, with both ends as attributes. */
export function ribbons(lines: Triple[][]): BufferGeometry {
  const segments = lines.reduce((sum, line) => sum + Math.max(line.length - 1, 0), 0);
  const [starts, ends] = [new Float32Array(12 * segments), new Float32Array(12 * segments)];
  const corners = new Float32Array(8 * segments);
  const index = new Uint32Array(6 * segments);
  let segment = 0;
  for (const line of lines) {
    for (let i = 0; i + 1 < line.length; i++, segment++) {
      for (let corner = 0; corner < 4; corner++) {
        starts.set(line[i]!, 12 * segment + 3 * corner);
        ends.set(line[i + 1]!, 12 * segment + 3 * corner);
      }
      corners.set([-1, -1, -1, 1, 1, -1, 1, 1], 8 * segment);
      index.set(
        [0, 1, 2, 2, 1, 3].map((corner) => 4 * segment + corner),
        6 * segment,
      );
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("start", new BufferAttribute(starts, 3));
  geometry.setAttribute("end", new BufferAttribute(ends, 3));
  geometry.setAttribute("corner", new BufferAttribute(corners, 2));
  geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}
