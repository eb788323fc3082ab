// The surface as it is drawn, with distances as colours.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DataTexture,
  DoubleSide,
  LinearFilter,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  RGBAFormat,
  ShaderMaterial,
} from "three";
import type { LoadedMesh } from "../mesh/loader";
import { INITIAL, type Palette } from "../state/state";
import { type Rgb, ramp, territory } from "./colours";
import { SECTION } from "./section";

const VERTEX = /* glsl */ `
  attribute float value;
  attribute vec3 tint;
  varying float v_value;
  varying vec3 v_tint;
  varying vec3 v_normal;
  varying vec3 v_eye;
  #include <clipping_planes_pars_vertex>
  void main() {
    v_value = value;
    v_tint = tint;
    v_normal = normalMatrix * normal;
    vec4 mvPosition = modelViewMatrix * vec4(position, 1.0); // as three's chunks call it
    v_eye = mvPosition.xyz;
    gl_Position = projectionMatrix * mvPosition;
    #include <clipping_planes_vertex>
  }`;

// Values are shares of the range of colours; far below it means unreached: one such vertex turns its
// whole face grey.
const FRAGMENT = /* glsl */ `
  const float UNREACHED = -1e3;
  uniform sampler2D ramp;
  uniform float tinted;
  uniform vec3 clay;
  varying float v_value;
  varying vec3 v_tint;
  varying vec3 v_normal;
  varying vec3 v_eye;
  uniform float lit;
  #include <clipping_planes_pars_fragment>
  void main() {
    #include <clipping_planes_fragment>
    vec3 colour = clay;
    if (v_value > UNREACHED) {
      float share = clamp(v_value, 0.0, 1.0);
      colour = texture2D(ramp, vec2(share * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;
      colour = mix(colour, v_tint * (1.06 - 0.36 * share), tinted);
    }
    vec3 normal = normalize(v_normal);
    vec3 eye = normalize(-v_eye);
    if (dot(normal, eye) < 0.0) normal = -normal; // from behind, or of a mesh wound the other way
    float key = max(dot(normal, normalize(vec3(0.35, 0.6, 0.9))), 0.0);
    float sky = 0.5 + 0.5 * normal.y;
    float gloss = pow(max(dot(normal, normalize(eye + vec3(0.35, 0.6, 0.9))), 0.0), 48.0);
    float edge = pow(1.0 - max(dot(normal, eye), 0.0), 4.0);
    colour *= mix(1.0, 0.50 + 0.14 * sky + 0.44 * key, lit);
    colour += lit * (0.10 * gloss + 0.06 * edge);
    gl_FragColor = vec4(colour, 1.0);
  }`;

const CLAY = new Color().setRGB(0.72, 0.74, 0.78);
/** Of a film: what is reached, and what is not. */
const REACHED = 0.96;
const UNREACHED = new Color().setRGB(0.4, 0.42, 0.47);

/** Return the material of all surfaces, made once because its shader takes long to compile. */
export function surfacePaint(): ShaderMaterial {
  return new ShaderMaterial({
    uniforms: {
      ramp: { value: rampTexture(INITIAL.palette) },
      tinted: { value: 0 },
      clay: { value: CLAY },
      lit: { value: 1 },
    },
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    clipping: true,
    clippingPlanes: SECTION,
    side: DoubleSide,
    // Objects on the surface are drawn in front of it.
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
}

/** Return a material that draws the same in front of surfaces, by the same colours. */
export function inFront(paint: ShaderMaterial): ShaderMaterial {
  const { uniforms } = paint;
  return new ShaderMaterial({
    uniforms,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    clipping: true,
    clippingPlanes: SECTION,
    side: DoubleSide,
  });
}

export class Surface {
  readonly object: Mesh<BufferGeometry, ShaderMaterial>;
  private readonly values: BufferAttribute;
  private readonly tints: BufferAttribute;
  private wires: LineSegments<BufferGeometry, LineBasicMaterial> | undefined;

  constructor(
    private readonly mesh: LoadedMesh,
    private readonly paint: ShaderMaterial,
  ) {
    const count = mesh.geometry.getAttribute("position").count;
    this.values = new BufferAttribute(new Float32Array(count), 1);
    this.tints = new BufferAttribute(new Float32Array(3 * count), 3);
    mesh.geometry.setAttribute("value", this.values);
    mesh.geometry.setAttribute("tint", this.tints);
    mesh.geometry.computeBoundingSphere();
    this.object = new Mesh(mesh.geometry, paint);
    this.setValues(null, 1);
    this.setTerritories(null);
  }

  /** Colour by values at vertices; vertices without a finite value are grey, with null all are. */
  setValues(values: ArrayLike<number> | null, largest: number, least = 0): void {
    const array = this.values.array;
    const extent = largest - least || 1;
    for (let i = 0; i < array.length; i++) {
      const share = values ? (values[i]! - least) / extent : Number.NaN;
      array[i] = Number.isFinite(share) ? Math.min(Math.max(share, -100), 100) : -1e9;
    }
    this.values.needsUpdate = true;
  }

  /** Light the vertices that have a finite value, and dim all others, until territories are set. */
  setReached(values: ArrayLike<number>, largest: number): void {
    this.setValues(values, largest);
    this.tints.array.fill(REACHED);
    this.tints.needsUpdate = true;
    this.uniform("tinted").value = 1;
    this.uniform("clay").value = UNREACHED;
  }

  /** Tint by the nearest source of each vertex; null: colour by value alone. */
  setTerritories(nearest: Int32Array | null): void {
    this.uniform("tinted").value = nearest ? 1 : 0;
    this.uniform("clay").value = CLAY;
    if (!nearest) return;
    const array = this.tints.array;
    for (let i = 0; i < nearest.length; i++) {
      if (nearest[i]! >= 0) array.set(territory(nearest[i]!), 3 * i);
    }
    this.tints.needsUpdate = true;
  }

  /** Colour by pieces, given by vertex; null: one colour for all. */
  setPieces(pieces: Int32Array | null): void {
    this.setValues(pieces && new Uint8Array(pieces.length), 1);
    this.setTerritories(pieces);
  }

  /** Show colours in a light, or as they are. */
  setLit(isLit: boolean): void {
    this.uniform("lit").value = isLit ? 1 : 0;
  }

  /** Draw what the mesh shows now: the surface, or its plane. */
  reshape(): void {
    const { shown } = this.mesh;
    shown.setAttribute("value", this.values);
    shown.setAttribute("tint", this.tints);
    this.object.geometry = shown;
  }

  setPalette(palette: Palette): void {
    const uniform = this.uniform("ramp");
    (uniform.value as DataTexture).dispose();
    uniform.value = rampTexture(palette);
  }

  async setWireframe(isVisible: boolean, colour: Rgb): Promise<void> {
    if (isVisible && !this.wires && !this.mesh.plane) {
      const edges = await this.mesh.allEdges();
      if (this.wires) return;
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", this.mesh.geometry.getAttribute("position"));
      geometry.setIndex(new BufferAttribute(edges, 1));
      const material = new LineBasicMaterial({
        transparent: true,
        opacity: 0.35,
        clippingPlanes: SECTION,
      });
      this.wires = new LineSegments(geometry, material);
      this.object.add(this.wires);
    }
    if (this.wires) {
      this.wires.visible = isVisible;
      this.wires.material.color.setRGB(...colour);
    }
  }

  dispose(): void {
    this.wires?.geometry.dispose();
    this.wires?.material.dispose();
  }

  private uniform(name: string): { value: unknown } {
    return this.paint.uniforms[name]!;
  }
}

function rampTexture(palette: Palette): DataTexture {
  const colours = ramp(palette);
  const pixels = Uint8Array.from(
    colours.flatMap((colour) => [...colour.map((x) => Math.round(255 * x)), 255]),
  );
  const texture = new DataTexture(pixels, colours.length, 1, RGBAFormat);
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
