// Polylines of constant width in pixels, with a casing, in front of the surface or faint behind it.
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
import { SECTION } from "./section";
import { simplified, type Triple } from "./simplified";

// Two vertices for each point, aside of the line, so that neighbouring segments share an edge and do
// not overlap. All lines are one mesh, drawn once: vertices take most of the time in software.
const VERTEX = /* glsl */ `
  attribute vec3 previous;
  attribute vec3 next;
  attribute float side;
  uniform vec2 resolution;
  uniform float width;
  uniform float before;
  varying float away;
  #include <clipping_planes_pars_vertex>

  const float NEAR = 0.01;

  vec4 projected(vec3 point) {
    return projectionMatrix * (modelViewMatrix * vec4(point, 1.0));
  }

  vec2 pixels(vec4 clip) {
    return 0.5 * resolution * clip.xy / max(clip.w, NEAR);
  }

  vec2 unit(vec2 way) {
    float extent = length(way);
    return extent > 0.0 ? way / extent : vec2(0.0);
  }

  void main() {
    vec4 clip = projected(position);
    vec2 here = pixels(clip);
    vec2 coming = unit(here - pixels(projected(previous)));
    vec2 going = unit(pixels(projected(next)) - here);
    if (going == vec2(0.0)) going = coming;
    vec2 along = unit(coming + going);
    if (along == vec2(0.0)) along = going;
    away = side * (0.5 * width + 1.0);
    float mitre = away / max(dot(along, going), 0.5); // a sharp bend is cut off
    clip.xy += 2.0 * mitre * vec2(-along.y, along.x) / resolution * clip.w;
    clip.z -= before * clip.w; // so that the surface does not cut it
    gl_Position = clip;
    vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);
    #include <clipping_planes_vertex>
  }`;

const FRAGMENT = /* glsl */ `
  uniform vec3 colour;
  uniform vec3 casing;
  uniform float opacity;
  uniform float inner;
  uniform float width;
  varying float away;
  #include <clipping_planes_pars_fragment>
  void main() {
    #include <clipping_planes_fragment>
    float line = clamp(0.5 * inner - abs(away) + 0.5, 0.0, 1.0);
    float all = clamp(0.5 * width - abs(away) + 0.5, 0.0, 1.0);
    gl_FragColor = vec4(mix(casing, colour, line), opacity * all);
  }`;

export interface Look {
  colour: number;
  casing: number;
  /** Pixels, of the line alone and with its casing. */
  inner: number;
  width: number;
  opacity: number;
  /** The offset in depth in front of the surface; null ignores the surface. */
  before: number | null;
  order: number;
}

/** Return a mesh that draws a geometry of `ribbons`. */
export function ribbonMesh(look: Look): Mesh {
  const { colour, casing, inner, width, opacity, before, order } = look;
  const resolution = new Vector2();
  const material = new ShaderMaterial({
    uniforms: {
      colour: { value: new Color(colour) },
      casing: { value: new Color(casing) },
      opacity: { value: opacity },
      inner: { value: inner },
      width: { value: width },
      before: { value: before ?? 0 },
      resolution: { value: resolution },
    },
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    transparent: true,
    side: DoubleSide,
    clipping: true,
    clippingPlanes: before === null ? [] : SECTION,
    depthTest: before !== null,
    depthWrite: false,
  });
  const line = new Mesh(new BufferGeometry(), material);
  line.userData.look = look;
  line.renderOrder = order;
  line.frustumCulled = false;
  line.onBeforeRender = (renderer) => {
    (renderer as WebGLRenderer).getDrawingBufferSize(resolution);
    material.uniforms.inner!.value = inner * renderer.getPixelRatio();
    material.uniforms.width!.value = width * renderer.getPixelRatio();
  };
  return line;
}

/** Return two vertices for each point of some polylines, which know the points beside theirs. */
export function ribbons(lines: Triple[][]): BufferGeometry {
  const drawn = lines.map(simplified).filter((line) => line.length > 1);
  const points = drawn.reduce((sum, line) => sum + line.length, 0);
  const [previous, here, next] = [0, 1, 2].map(() => new Float32Array(6 * points)) as [
    Float32Array,
    Float32Array,
    Float32Array,
  ];
  const sides = new Float32Array(2 * points);
  const index = new Uint32Array(6 * (points - drawn.length));
  let point = 0;
  let segment = 0;
  for (const line of drawn) {
    const last = line.length - 1;
    const isClosed = last > 2 && line[0]!.every((x, axis) => x === line[last]![axis]);
    for (let i = 0; i <= last; i++, point++) {
      for (const side of [0, 1]) {
        const at = 3 * (2 * point + side);
        previous.set(line[i > 0 ? i - 1 : isClosed ? last - 1 : 0]!, at);
        here.set(line[i]!, at);
        next.set(line[i < last ? i + 1 : isClosed ? 1 : last]!, at);
        sides[2 * point + side] = side ? 1 : -1;
      }
      if (i === last) continue;
      const first = 2 * point;
      index.set([first, first + 1, first + 2, first + 2, first + 1, first + 3], 6 * segment++);
    }
  }
  const geometry = new BufferGeometry();
  geometry.userData.lines = drawn;
  geometry.setAttribute("position", new BufferAttribute(here, 3));
  geometry.setAttribute("previous", new BufferAttribute(previous, 3));
  geometry.setAttribute("next", new BufferAttribute(next, 3));
  geometry.setAttribute("side", new BufferAttribute(sides, 1));
  geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}
