// The path as a line of constant width in pixels, with a casing; faint where the surface hides it.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  Group,
  Mesh,
  ShaderMaterial,
  Vector2,
  type WebGLRenderer,
} from "three";
import type { Stage } from "./scene";

const COLOUR = 0xe6005c;
const CASING = 0xffffff;

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

interface Look {
  colour: number;
  /** Pixels. */
  width: number;
  opacity: number;
  /** The offset in depth in front of the surface; null ignores the surface. */
  before: number | null;
  order: number;
}

export class RouteLine {
  private readonly object = new Group();
  private geometry = new BufferGeometry();

  constructor(private readonly stage: Stage) {
    this.object.add(
      this.line({ colour: COLOUR, width: 3, opacity: 0.28, before: null, order: 3 }),
      this.line({ colour: CASING, width: 7, opacity: 0.95, before: 0.006, order: 4 }),
      this.line({ colour: COLOUR, width: 4, opacity: 1, before: 0.0072, order: 5 }),
    );
    this.object.visible = false;
    stage.addOverlay(this.object);
  }

  /** Show a line through drawn positions; fewer than two hide it. */
  show(points: [number, number, number][]): void {
    this.object.visible = points.length > 1;
    this.geometry.dispose();
    this.geometry = ribbon(points);
    for (const line of this.object.children) (line as Mesh).geometry = this.geometry;
    this.stage.invalidateOverlay();
  }

  private line({ colour, width, opacity, before, order }: Look): Mesh {
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
    const line = new Mesh(this.geometry, material);
    line.renderOrder = order;
    line.frustumCulled = false;
    line.onBeforeRender = (renderer) => {
      (renderer as WebGLRenderer).getDrawingBufferSize(resolution);
      material.uniforms.width!.value = width * renderer.getPixelRatio();
    };
    return line;
  }
}

/** Return four corners for each segment of a polyline, with both ends as attributes. */
function ribbon(points: [number, number, number][]): BufferGeometry {
  const segments = Math.max(points.length - 1, 0);
  const [starts, ends] = [new Float32Array(12 * segments), new Float32Array(12 * segments)];
  const corners = new Float32Array(8 * segments);
  const index = new Uint32Array(6 * segments);
  for (let i = 0; i < segments; i++) {
    for (let corner = 0; corner < 4; corner++) {
      starts.set(points[i]!, 12 * i + 3 * corner);
      ends.set(points[i + 1]!, 12 * i + 3 * corner);
    }
    corners.set([-1, -1, -1, 1, 1, -1, 1, 1], 8 * i);
    index.set(
      [0, 1, 2, 2, 1, 3].map((corner) => 4 * i + corner),
      6 * i,
    );
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("start", new BufferAttribute(starts, 3));
  geometry.setAttribute("end", new BufferAttribute(ends, 3));
  geometry.setAttribute("corner", new BufferAttribute(corners, 2));
  geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}
