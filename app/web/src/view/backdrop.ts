// The mesh as an image with depths, so that overlays move over it without drawing it again.
import {
  AlwaysDepth,
  Camera,
  DepthTexture,
  Mesh,
  NoBlending,
  PlaneGeometry,
  Scene,
  ShaderMaterial,
  Vector2,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "three";

const VERTEX = /* glsl */ `
  varying vec2 place;
  void main() {
    place = uv;
    gl_Position = vec4(position.xy, 0.0, 1.0);
  }`;

const FRAGMENT = /* glsl */ `
  uniform sampler2D colours;
  uniform sampler2D depths;
  varying vec2 place;
  void main() {
    gl_FragColor = texture2D(colours, place);
    gl_FragDepth = texture2D(depths, place).r;
  }`;

/** Samples of each pixel, which smooth edges. */
const SAMPLES = 4;
const MANY_FACES = 50_000;

export class Backdrop {
  private isFresh = false;
  private readonly target = new WebGLRenderTarget(1, 1, {
    samples: SAMPLES,
    depthTexture: new DepthTexture(1, 1),
  });
  private readonly screen = new Scene();
  private readonly camera = new Camera();

  constructor(private readonly renderer: WebGLRenderer) {
    const material = new ShaderMaterial({
      uniforms: {
        colours: { value: this.target.texture },
        depths: { value: this.target.depthTexture },
      },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      blending: NoBlending,
      depthFunc: AlwaysDepth,
    });
    const quad = new Mesh(new PlaneGeometry(2, 2), material);
    quad.frustumCulled = false;
    this.screen.add(quad);
  }

  /** Draw ``scene``: from its image, which is rendered again only after a change. */
  draw(scene: Scene, camera: Camera): void {
    if (!this.isFresh) {
      const size = this.renderer.getDrawingBufferSize(new Vector2());
      this.target.setSize(size.x, size.y);
      this.renderer.setRenderTarget(this.target);
      this.renderer.clear();
      this.renderer.render(scene, camera);
      this.renderer.setRenderTarget(null);
      this.isFresh = true;
    }
    this.renderer.render(this.screen, this.camera);
  }

  /**
   * Choose how smoothly edges of a mesh of so many faces are drawn. Without a graphics card, a large
   * mesh takes twice as long with several samples a pixel.
   */
  fit(faces: number): void {
    const samples = this.isSoftware && faces > MANY_FACES ? 0 : SAMPLES;
    if (samples === this.target.samples) return;
    this.target.samples = samples;
    this.target.dispose(); // it is made anew when it is drawn
    this.forget();
  }

  private get isSoftware(): boolean {
    const gl = this.renderer.getContext();
    const named = gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL;
    return /swiftshader|llvmpipe|software/i.test(String(gl.getParameter(named ?? gl.RENDERER)));
  }

  /** Drop the image, after the scene or the camera has changed. */
  forget(): void {
    this.isFresh = false;
  }
}
