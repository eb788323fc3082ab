// Windows of a sweep as ribbons along their edges, each inside the face that it is about to cross.

import type { SweepAnswer } from "geodesic-client";
import {
  BufferAttribute,
  DoubleSide,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  ShaderMaterial,
} from "three";
import type { LoadedMesh } from "../mesh/loader";
import type { Rgb } from "./colours";
import type { Stage } from "./scene";
import { SECTION } from "./section";

/** Steps in which a trimmed window fades. */
const FADING = 6;
/** Depth of a ribbon, as a share of the way from its edge to the centre of the face. */
const DEPTH = 0.6;
const NEVER = 1e9;

/** Colours that the page names below the film: of windows that wait, cross a face, and are trimmed. */
const FRONT: Rgb = [1, 0.8, 0.1];
const CROSSING: Rgb = [0.525, 0.15, 0.92];
const TRIMMED: Rgb = [0.95, 0.1, 0.15];

// Ribbons of the three edges of a face share it out, and never overlap: each is cut along the lines
// from the corners to the centre.
const VERTEX = /* glsl */ `
  attribute vec2 corner;
  attribute vec3 start;
  attribute vec3 end;
  attribute vec3 centre;
  attribute vec3 life;
  attribute vec3 tint;
  uniform float step;
  varying vec4 v_colour;
  varying vec2 v_corner;
  #include <clipping_planes_pars_vertex>

  void main() {
    bool waits = life.y > step;
    bool isThere = life.x <= step && life.z > step;
    float faded = (step - life.z) / FADING;
    if (!isThere && !(life.x <= life.z && faded >= 0.0 && faded < 1.0)) {
      gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
      return;
    }
    float depth = DEPTH * (isThere && !waits ? 0.55 : 1.0);
    vec3 place = mix(mix(start, end, corner.x), centre, depth * corner.y);
    vec4 mvPosition = modelViewMatrix * vec4(place, 1.0);
    #include <clipping_planes_vertex>
    vec4 clip = projectionMatrix * mvPosition;
    clip.z -= (isThere ? waits ? 4e-4 : 2e-4 : 6e-4) * clip.w;
    gl_Position = clip;
    v_corner = corner;
    v_colour = vec4(tint, 0.95);
    if (!isThere) v_colour = vec4(TRIMMED, 1.0 - faded);
    else if (waits) v_colour = vec4(FRONT, 1.0);
    else if (life.y == step) v_colour = vec4(CROSSING, 1.0);
  }`;

const FRAGMENT = /* glsl */ `
  varying vec4 v_colour;
  varying vec2 v_corner;
  #include <clipping_planes_pars_fragment>
  void main() {
    #include <clipping_planes_fragment>
    // A dark line at both ends sets apart the windows of one pseudosource.
    float away = min(v_corner.x, 1.0 - v_corner.x) / max(fwidth(v_corner.x), 1e-6);
    float line = 1.0 - clamp(away, 0.0, 1.0);
    gl_FragColor = vec4(mix(v_colour.rgb, vec3(0.05), 0.55 * line), v_colour.a);
  }`;

const glsl = (colour: Rgb): string => `vec3(${colour.map((x) => x.toFixed(3)).join(", ")})`;

export class WindowLayer {
  private readonly object: Mesh<InstancedBufferGeometry, ShaderMaterial>;

  constructor(private readonly stage: Stage) {
    const defines = {
      FADING: FADING.toFixed(1),
      DEPTH: DEPTH.toFixed(3),
      FRONT: glsl(FRONT),
      CROSSING: glsl(CROSSING),
      TRIMMED: glsl(TRIMMED),
    };
    const material = new ShaderMaterial({
      defines,
      uniforms: { step: { value: 0 } },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      clipping: true,
      clippingPlanes: SECTION,
      transparent: true,
      depthWrite: false,
      side: DoubleSide,
    });
    this.object = new Mesh(new InstancedBufferGeometry(), material);
    this.object.frustumCulled = false;
    this.object.renderOrder = 2;
    this.object.visible = false;
    stage.add(this.object);
  }

  /** Take the windows of a sweep, each in the colour of its pseudosource; null: none. */
  take(
    mesh: LoadedMesh | null,
    windows: SweepAnswer["windows"] | null,
    colourOf: (pseudosource: number | null) => Rgb,
  ): void {
    this.object.geometry.dispose();
    this.object.geometry =
      mesh && windows ? geometryOf(mesh, windows, colourOf) : new InstancedBufferGeometry();
    this.object.visible = mesh !== null && windows !== null;
    this.stage.invalidate();
  }

  show(step: number): void {
    this.object.material.uniforms.step!.value = step;
    this.stage.invalidate();
  }
}

function geometryOf(
  mesh: LoadedMesh,
  windows: SweepAnswer["windows"],
  colourOf: (pseudosource: number | null) => Rgb,
): InstancedBufferGeometry {
  const size = windows.first.length;
  const [start, end, centre, life, tint] = Array.from(
    { length: 5 },
    () => new Float32Array(3 * size),
  ) as [Float32Array, Float32Array, Float32Array, Float32Array, Float32Array];
  const drawn = (vertex: number) => mesh.drawn(mesh.vertex(vertex));
  for (let i = 0; i < size; i++) {
    const [tail, head] = [drawn(windows.tails[i]!), drawn(windows.heads[i]!)];
    const corners = mesh.corners(windows.faces[i]!).map(drawn);
    const a = mesh.vertex(windows.tails[i]!);
    const b = mesh.vertex(windows.heads[i]!);
    const length = Math.hypot(...a.map((x, axis) => b[axis]! - x)) || 1;
    for (let axis = 0; axis < 3; axis++) {
      const along = head[axis]! - tail[axis]!;
      start[3 * i + axis] = tail[axis]! + (windows.b0[i]! / length) * along;
      end[3 * i + axis] = tail[axis]! + (windows.b1[i]! / length) * along;
      centre[3 * i + axis] = (corners[0]![axis]! + corners[1]![axis]! + corners[2]![axis]!) / 3;
    }
    life.set([windows.first[i]!, windows.crossed[i] ?? NEVER, windows.last[i] ?? NEVER], 3 * i);
    tint.set(colourOf(windows.pseudosources[i] ?? null), 3 * i);
  }
  const geometry = new InstancedBufferGeometry();
  const quad = new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]);
  geometry.setAttribute("corner", new BufferAttribute(quad, 2));
  geometry.setIndex([0, 1, 2, 2, 1, 3]);
  for (const [name, array] of Object.entries({ start, end, centre, life, tint }))
    geometry.setAttribute(name, new InstancedBufferAttribute(array, 3));
  geometry.instanceCount = size;
  return geometry;
}
