import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  Color,
  ConeGeometry,
  CylinderGeometry,
  DirectionalLight,
  DoubleSide,
  EdgesGeometry,
  GridHelper,
  Group,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshStandardMaterial,
  Object3D,
  PerspectiveCamera,
  PlaneGeometry,
  Quaternion,
  Scene,
  SphereGeometry,
  Sprite,
  SpriteMaterial,
  Vector3,
  WebGLRenderer,
  type Material,
} from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';
import type {Shape, Touch, Vector3 as Triple} from '../model/sample';
import {kColumn, type Track} from '../store/motion';

/** The workspace of a device as it is drawn. */
export interface Room {
  readonly low: Triple;
  readonly high: Triple;
  readonly forceMaxNewton: number;
  /** The device has no workspace of its own. */
  readonly isAssumed: boolean;
}

export interface Shown {
  readonly track: Track | null;
  readonly endS: number | null;
  readonly touch: Touch | null;
  readonly isFresh: boolean;
}

export type ViewName = 'corner' | 'front' | 'side' | 'top';

const kTrailS = 4;
const kTrailMax = 300;
/** From clients/scene/scene.hpp: the ball's radius, and the ridges' height and spacing. */
const kBallM = 0.03;
const kRidgeM = 0.003;
const kRidgeSpacingM = 0.015;
/** So much of the room's size is drawn for the greatest force. */
const kForceShare = 0.8;

const kDirections: Readonly<Record<ViewName, Triple>> = {
  corner: [0.95, -1.45, 0.85],
  front: [0, -1.9, 0.0001],
  side: [1.9, 0, 0.0001],
  top: [0, -0.0001, 1.9],
};

type Colour = (name: string) => string;

/** The 3-D view: device, trail, proxy, force and what is touched. z points up. */
export class Space {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(38, 1, 0.001, 50);
  private readonly controls: OrbitControls;
  private readonly tool = new Group();
  private readonly proxy: Mesh;
  private readonly link: Line;
  private readonly trail: Line;
  private readonly arrow = new Group();
  private readonly shaft: Mesh;
  private readonly head: Mesh;
  private readonly tip = new Vector3();
  private surface: Mesh | null = null;
  private surfaceKey = '';
  private isDirty = true;
  private lastMs = -1;
  private readonly size: number;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly room: Room,
    private readonly colour: Colour,
  ) {
    this.renderer = new WebGLRenderer({canvas, antialias: true, alpha: true});
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.size = Math.max(...room.high.map((high, i) => high - (room.low[i] ?? 0)), 1e-3);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => (this.isDirty = true));
    this.controls.minDistance = 0.3 * this.size;
    this.controls.maxDistance = 6 * this.size;
    const unit = this.size / 70;
    this.addRoom();
    this.addTool(unit);
    this.proxy = new Mesh(new SphereGeometry(1.6 * unit, 24, 16), this.solid('proxy'));
    this.link = new Line(lineOf(2), new LineBasicMaterial({color: this.paint('proxy')}));
    this.trail = new Line(
      lineOf(kTrailMax, true),
      new LineBasicMaterial({vertexColors: true, transparent: true}),
    );
    this.trail.frustumCulled = this.link.frustumCulled = false;
    this.shaft = new Mesh(new CylinderGeometry(0.9 * unit, 0.9 * unit, 1, 16), this.solid('force'));
    this.head = new Mesh(new ConeGeometry(2.2 * unit, 5 * unit, 20), this.solid('force'));
    this.arrow.add(this.shaft, this.head);
    this.scene.add(this.proxy, this.link, this.trail, this.arrow);
    this.look('corner');
  }

  /** The length of an arrow for a newton. */
  get millimetresPerNewton(): number {
    return (1000 * kForceShare * this.size) / Math.max(this.room.forceMaxNewton, 1e-9);
  }

  look(view: ViewName): void {
    const centre = this.centre();
    const [x, y, z] = kDirections[view];
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).add(new Vector3(x, y, z).multiplyScalar(1.42 * this.size));
    this.controls.update();
    this.isDirty = true;
  }

  /** Turns by degrees about the vertical, and up; for the keyboard. */
  turn(degrees: number, upDegrees: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    offset.applyAxisAngle(new Vector3(0, 0, 1), (degrees * Math.PI) / 180);
    const sideways = new Vector3(0, 0, 1).cross(offset).normalize();
    const raised = offset.clone().applyAxisAngle(sideways, (-upDegrees * Math.PI) / 180);
    if (Math.hypot(raised.x, raised.y) > 0.02 * this.size) offset.copy(raised);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
  }

  zoom(factor: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    offset.clampLength(this.controls.minDistance, this.controls.maxDistance);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
  }

  resize(width: number, height: number): void {
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    // A tall and narrow view shows all of the room's width, too.
    this.camera.fov = this.camera.aspect >= 1 ? 38 : 38 / Math.max(0.5, this.camera.aspect);
    this.camera.updateProjectionMatrix();
    this.isDirty = true;
  }

  /** Draws if anything has changed. @returns where the force's number belongs, in pixels. */
  paint3d(shown: Shown): {x: number; y: number} | null {
    const {track} = shown;
    const newestMs = Math.max(track?.sampleMs ?? 0, track?.touchMs ?? 0);
    const hasTouch = shown.touch !== null;
    if (this.isDirty || newestMs !== this.lastMs || this.proxy.visible !== hasTouch) {
      this.isDirty = false;
      this.lastMs = newestMs;
      this.place(shown);
      this.renderer.render(this.scene, this.camera);
    }
    if (!this.arrow.visible) return null;
    const at = this.tip.clone().project(this.camera);
    return {
      x: ((at.x + 1) / 2) * this.canvas.clientWidth,
      y: ((1 - at.y) / 2) * this.canvas.clientHeight,
    };
  }

  dispose(): void {
    this.controls.dispose();
    this.scene.traverse((one) => release(one));
    this.renderer.dispose();
  }

  private centre(): Vector3 {
    const [x, y, z] = this.room.low.map((low, i) => (low + (this.room.high[i] ?? 0)) / 2);
    return new Vector3(x, y, z);
  }

  private place({track, endS, touch, isFresh}: Shown): void {
    const sample = track?.sample ?? null;
    this.tool.visible = sample !== null;
    if (sample !== null) {
      this.tool.position.set(...sample.positionM);
      const [x, y, z, w] = sample.orientation;
      if (Math.hypot(x, y, z, w) > 0.5) this.tool.quaternion.set(x, y, z, w);
    }
    this.placeTrail(track, endS);
    this.placeTouch(touch, sample?.positionM ?? null);
    this.placeForce(sample?.positionM ?? null, isFresh ? (sample?.forceNewton ?? null) : null);
  }

  private placeTrail(track: Track | null, endS: number | null): void {
    const series = track?.series;
    const positions = this.trail.geometry.getAttribute('position') as BufferAttribute;
    const colours = this.trail.geometry.getAttribute('color') as BufferAttribute;
    let count = 0;
    if (series !== undefined && endS !== null) {
      const first = Math.max(series.rowAt(endS - kTrailS), series.size - kTrailMax);
      const paint = new Color(this.paint('tool'));
      for (let row = first; row < series.size; ++row, ++count) {
        const at = (axis: number) => series.valueAt(row, kColumn.position + axis);
        const share = 1 - (endS - series.timeAt(row)) / kTrailS;
        positions.setXYZ(count, at(0), at(1), at(2));
        colours.setXYZW(count, paint.r, paint.g, paint.b, Math.max(0, 0.85 * share));
      }
    }
    this.trail.geometry.setDrawRange(0, count);
    positions.needsUpdate = colours.needsUpdate = true;
  }

  private placeTouch(touch: Touch | null, device: Triple | null): void {
    this.proxy.visible = touch !== null;
    this.link.visible = touch !== null && device !== null;
    this.showSurface(touch);
    if (touch === null) return;
    this.proxy.position.set(...touch.proxyM);
    if (device === null) return;
    const positions = this.link.geometry.getAttribute('position') as BufferAttribute;
    positions.setXYZ(0, ...device);
    positions.setXYZ(1, ...touch.proxyM);
    positions.needsUpdate = true;
  }

  private placeForce(at: Triple | null, force: Triple | null): void {
    const newton = force === null ? 0 : Math.hypot(...force);
    this.arrow.visible = at !== null && newton > 1e-3;
    if (at === null || force === null || !this.arrow.visible) return;
    const length = (newton * this.millimetresPerNewton) / 1000;
    const direction = new Vector3(...force).normalize();
    const headLength = Math.min(0.05 * this.size, length);
    const shaftLength = Math.max(1e-6, length - headLength);
    this.arrow.position.set(...at);
    this.arrow.quaternion.copy(
      new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), direction),
    );
    this.shaft.scale.set(1, shaftLength, 1);
    this.shaft.position.set(0, shaftLength / 2, 0);
    this.head.scale.setScalar(headLength / (0.05 * this.size));
    this.head.position.set(0, length - headLength / 2, 0);
    this.tip.set(...at).addScaledVector(direction, length + 0.06 * this.size);
  }

  private showSurface(touch: Touch | null): void {
    const key = touch === null ? '' : `${touch.shape} ${touch.faceM}`;
    if (key === this.surfaceKey) return;
    this.surfaceKey = key;
    if (this.surface !== null) {
      this.scene.remove(this.surface);
      release(this.surface);
      this.surface = null;
    }
    if (touch === null) return;
    this.surface = new Mesh(
      this.surfaceOf(touch.shape),
      new MeshStandardMaterial({
        color: this.paint('wall'),
        transparent: true,
        opacity: 0.55,
        roughness: 0.8,
        side: DoubleSide,
        depthWrite: false,
      }),
    );
    this.surface.position.set(0, 0, touch.shape === 'sphere' ? touch.faceM - kBallM : touch.faceM);
    this.scene.add(this.surface);
  }

  private surfaceOf(shape: Shape): BufferGeometry {
    if (shape === 'sphere') return new SphereGeometry(kBallM, 48, 32);
    const width = this.room.high[0] - this.room.low[0];
    const depth = this.room.high[1] - this.room.low[1];
    if (shape === 'plane') return new PlaneGeometry(width, depth);
    const plane = new PlaneGeometry(width, depth, 320, 1);
    const positions = plane.getAttribute('position') as BufferAttribute;
    for (let i = 0; i < positions.count; ++i) {
      const wave = Math.cos((2 * Math.PI * positions.getX(i)) / kRidgeSpacingM);
      positions.setZ(i, (-kRidgeM / 2) * (1 - wave));
    }
    plane.computeVertexNormals();
    return plane;
  }

  private addRoom(): void {
    const {low, high, isAssumed} = this.room;
    const extent = high.map((one, i) => one - (low[i] ?? 0)) as [number, number, number];
    const centre = this.centre();
    if (!isAssumed) {
      const box = new BoxGeometry(...extent);
      const edges = new LineSegments(
        new EdgesGeometry(box),
        new LineBasicMaterial({color: this.paint('edge')}),
      );
      box.dispose();
      edges.position.copy(centre);
      this.scene.add(edges);
    }
    const grid = new GridHelper(
      Math.max(extent[0], extent[1]),
      10,
      this.paint('grid'),
      this.paint('grid'),
    );
    grid.rotateX(Math.PI / 2);
    grid.position.set(centre.x, centre.y, low[2]);
    this.scene.add(grid);
    const bright = new DirectionalLight(0xffffff, 1.6);
    bright.position.set(0.4, -0.8, 1.5);
    this.scene.add(new HemisphereLight(0xffffff, 0x8899aa, 1.6), bright);
    ['x', 'y', 'z'].forEach((name, i) => this.addAxis(name, i));
  }

  private addAxis(name: string, axis: number): void {
    const start = new Vector3(...this.room.low);
    const end = start.clone();
    const extent = this.room.high[axis as 0 | 1 | 2] - this.room.low[axis as 0 | 1 | 2];
    end.setComponent(axis, start.getComponent(axis) + 0.35 * extent);
    const shaft = new CylinderGeometry(0.004 * this.size, 0.004 * this.size, 0.35 * extent, 10);
    const rod = new Mesh(shaft, this.solid(name));
    rod.position.copy(start).add(end).multiplyScalar(0.5);
    if (axis === 0) rod.rotateZ(Math.PI / 2);
    if (axis === 2) rod.rotateX(Math.PI / 2);
    const label = new Sprite(new SpriteMaterial({map: letter(name, this.colour(name))}));
    label.scale.setScalar(0.085 * this.size);
    label.position.copy(end);
    label.position.setComponent(axis, end.getComponent(axis) + 0.045 * this.size);
    this.scene.add(rod, label);
  }

  private addTool(unit: number): void {
    const ball = new Mesh(new SphereGeometry(2 * unit, 24, 16), this.solid('tool'));
    this.tool.add(ball);
    // Its orientation, as three short rods.
    ['x', 'y', 'z'].forEach((name, axis) => {
      const rod = new Mesh(
        new CylinderGeometry(0.5 * unit, 0.5 * unit, 6 * unit, 10),
        this.solid(name),
      );
      if (axis === 0) rod.rotateZ(Math.PI / 2);
      if (axis === 2) rod.rotateX(Math.PI / 2);
      rod.position.setComponent(axis, 3 * unit);
      this.tool.add(rod);
    });
    this.scene.add(this.tool);
  }

  private paint(name: string): string {
    return this.colour(name);
  }

  private solid(name: string): MeshStandardMaterial {
    return new MeshStandardMaterial({color: this.paint(name), roughness: 0.55});
  }
}

function lineOf(pointCount: number, hasColours = false): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(3 * pointCount), 3));
  if (hasColours) {
    geometry.setAttribute('color', new BufferAttribute(new Float32Array(4 * pointCount), 4));
  }
  return geometry;
}

function letter(name: string, paint: string): CanvasTexture {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 64;
  const context = canvas.getContext('2d');
  if (context !== null) {
    context.fillStyle = paint;
    context.font = '600 44px system-ui, sans-serif';
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.fillText(name, 32, 32);
  }
  return new CanvasTexture(canvas);
}

function release(one: Object3D): void {
  if (one instanceof Mesh || one instanceof Line) {
    (one.geometry as BufferGeometry).dispose();
    (one.material as Material).dispose();
  } else if (one instanceof Sprite) {
    one.material.map?.dispose();
    one.material.dispose();
  }
}
