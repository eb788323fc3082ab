// Points of the surface, drawn as discs of constant size on the screen.
import { BufferAttribute, BufferGeometry, Points, ShaderMaterial } from "three";
import type { Rgb } from "./colours";
import type { Stage } from "./scene";
import { SECTION } from "./section";

// Discs face the camera, slightly in front of their point, so that the surface does not cut them.
const VERTEX = /* glsl */ `
  attribute vec3 fill;
  attribute float size;
  uniform float ratio;
  varying vec3 v_fill;
  varying float v_size;
  #include <clipping_planes_pars_vertex>
  void main() {
    v_fill = fill;
    v_size = size * ratio;
    vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);
    #include <clipping_planes_vertex>
    vec4 eye = mvPosition;
    eye.xyz *= 1.0 - 0.02 / max(length(eye.xyz), 0.05);
    gl_Position = projectionMatrix * eye;
    gl_PointSize = v_size;
  }`;

const FRAGMENT = /* glsl */ `
  uniform float ratio;
  uniform float opacity;
  varying vec3 v_fill;
  varying float v_size;
  #include <clipping_planes_pars_fragment>
  void main() {
    #include <clipping_planes_fragment>
    float away = length(gl_PointCoord - 0.5) * v_size;
    float rim = 0.5 * v_size - away;
    vec3 colour = mix(vec3(1.0), v_fill, smoothstep(2.2 * ratio, 3.2 * ratio, rim));
    colour = mix(vec3(0.12), colour, smoothstep(0.2 * ratio, 1.2 * ratio, rim));
    gl_FragColor = vec4(colour, opacity * smoothstep(0.0, ratio, rim));
  }`;

/** The time that a dragged target waits, to be drawn together with its path. */
const PATIENCE_MS = 40;

export interface Mark {
  position: [number, number, number];
  fill: Rgb;
  /** Diameter, in pixels. */
  size: number;
}

export class Markers {
  private readonly seen = this.points(1, true, 11);
  private readonly hidden = this.points(0.25, false, 10);

  constructor(private readonly stage: Stage) {
    stage.addOverlay(this.hidden);
    stage.addOverlay(this.seen);
  }

  show(marks: Mark[]): void {
    const geometry = new BufferGeometry();
    geometry.userData.points = marks;
    const attribute = (numbers: number[], size: number): BufferAttribute =>
      new BufferAttribute(new Float32Array(numbers), size);
    geometry.setAttribute(
      "position",
      attribute(
        marks.flatMap(({ position }) => position),
        3,
      ),
    );
    geometry.setAttribute(
      "fill",
      attribute(
        marks.flatMap(({ fill }) => fill),
        3,
      ),
    );
    geometry.setAttribute(
      "size",
      attribute(
        marks.map(({ size }) => size),
        1,
      ),
    );
    this.seen.geometry.dispose();
    const ratio = this.stage.renderer.getPixelRatio();
    for (const points of [this.seen, this.hidden]) {
      points.geometry = geometry;
      points.visible = marks.length > 0;
      points.material.uniforms.ratio!.value = ratio;
    }
    this.stage.invalidateOverlay(PATIENCE_MS);
  }

  private points(
    opacity: number,
    depthTest: boolean,
    order: number,
  ): Points<BufferGeometry, ShaderMaterial> {
    const material = new ShaderMaterial({
      uniforms: { ratio: { value: 1 }, opacity: { value: opacity } },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      transparent: true,
      clipping: true,
      clippingPlanes: depthTest ? SECTION : [],
      depthTest,
      depthWrite: false,
    });
    const points = new Points(new BufferGeometry(), material);
    points.userData.marks = { opacity, hidden: !depthTest };
    points.renderOrder = order;
    points.frustumCulled = false;
    return points;
  }
}
