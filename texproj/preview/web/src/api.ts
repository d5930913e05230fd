// What the server knows and does; the only module that makes requests.

import type { Camera, Vec2, Vec3 } from "./lens.ts";
import type { Axis } from "./upright.ts";

export interface PhotoFacts {
  name: string;
  status: "none" | "broken" | "registered" | "prior" | "failed" | "excluded";
  width?: number;
  height?: number;
  method?: string | null;
  expected_error_px?: number | null;
  weak?: boolean;
  reason?: string;
  advice: string;
  picks: number;
  picks_error?: string;
  mask?: boolean;
  notes?: string[];
  quality?: Record<string, number | string>;
  camera?: Camera;
}

export interface Job {
  id: number;
  kind: string;
  title: string;
  subject: string;
  state: "waiting" | "running" | "done" | "failed" | "cancelled";
  stage: string;
  done: number;
  total: number;
  item: string;
  /** Seconds until the stage is done, where that can be told. */
  left_s: number | null;
  message: string;
}

export interface Facts {
  name: string;
  mesh: { key: string; file: string };
  photos: PhotoFacts[];
  models: Record<string, string | null>;
  /** Files to be taken away, and the word for each. */
  downloads: { name: string; word: string }[];
  /** Photos that are left out of everything. */
  excluded: string[];
  /** Whether the textured model is that of the surface itself, to be lit. */
  lit: boolean;
  /** What is made: vertices, texture or patches. */
  to: string;
  report: string | null;
  /** The axis that a person chose to be up on this page. */
  up: Axis | null;
  jobs: Job[];
}

export interface SavedPick {
  name: string;
  uv: Vec2;
  xyz: Vec3;
  normal?: Vec3;
}

export interface SavedPicks {
  version: string;
  picks: SavedPick[];
}

export interface Fit {
  camera: Camera;
  expected_error_px: number | null;
  accepted: boolean;
  /** Not accepted, but good enough to say where other points lie. */
  rough: boolean;
  reason: string;
  names: string[];
  projected: [number | null, number | null][];
  residual_px: (number | null)[];
  inliers: boolean[];
  /** Whether each pick was part of it. */
  used: boolean[];
}

export interface Hit {
  xyz: Vec3;
  normal: Vec3;
  /** Whether the surface is seen from behind there. */
  back: boolean;
}

export interface Prediction extends Hit {
  uv: Vec2;
  score: number;
}

/** A point picked in another photo, where it should lie in this one. */
export interface Proposal extends Prediction {
  photo: string;
  name: string;
}

export interface MaskFacts {
  version: string;
  file: string | null;
  /** How many steps can be taken back. */
  undo: number;
}

export interface Stroke {
  base: string;
  kind: "paint" | "erase" | "grow" | "clear" | "undo";
  radius?: number;
  points?: Vec2[];
}

export type SettingValue = string | number | boolean | string[] | number[] | null;

export interface Setting {
  key: string;
  help: string;
  kind: "choice" | "several" | "place" | "flag" | "number" | "integer" | "text";
  choices?: (string | number)[];
  least?: number | null;
  most?: number | null;
  value: SettingValue;
  default: SettingValue;
  /** Whether it stands in project.toml. */
  given: boolean;
}

export interface SettingsTable {
  name: string;
  help: string;
  options: Setting[];
}

export interface SettingsForm {
  version: string;
  tables: SettingsTable[];
}

/** Where all photos together may be. support: share of the model's structure in place there. */
export interface Place {
  support: number;
  points: Vec3[];
  cameras: Record<string, Camera>;
}

/** draft: the best place so far while photos are placed; question: which of several is right. */
export interface Places {
  draft: Place | null;
  question: {
    photos: string[];
    /** The photos through which the places are shown. */
    looks: string[];
    places: Place[];
    /** A number from 1, 0 for none of them, null as long as nobody has chosen. */
    answer: number | null;
  } | null;
}

export type Rgb = Vec3;

/** How the surface can be lit anew; directions are unit vectors in the scan's frame. */
export interface Lights {
  up: Vec3;
  front: Vec3;
  right: Vec3;
  /** Nine spherical harmonics of an open surface's irradiance. */
  skies: { overcast: Rgb[]; photographed?: Rgb[]; picture?: Rgb[]; none?: Rgb[] };
  /** Of the photos, where they had one. */
  sun: { direction: Vec3; irradiance: Rgb } | null;
  sun_lux: number;
  kelvin: number[];
  tints: Rgb[];
}

/** One of materials.json. */
export interface Material {
  name: string;
  metallic: boolean;
  roughness: number;
  /** What it mirrors at normal incidence, where the photos tell it. */
  f0: number | null;
  share: number;
  /** Linear. */
  base_color: Rgb | null;
}

export interface Pack {
  facts: Record<string, unknown>;
  arrays: Record<string, Float32Array | Uint32Array | Uint8Array | Int8Array>;
}

/** The server answered, but not with what was asked for. */
export class Refusal extends Error {
  status: number;
  constructor(status: number, sentence: string) {
    super(sentence);
    this.status = status;
  }
}

/** The server did not answer at all. */
export class Silence extends Error {}

async function request(path: string, init: RequestInit = {}): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path, init);
  } catch {
    throw new Silence("The server does not answer.");
  }
  return answer;
}

async function demand(path: string, init: RequestInit = {}): Promise<Response> {
  const answer = await request(path, init);
  if (!answer.ok) throw await refusalOf(answer);
  return answer;
}

async function refusalOf(answer: Response): Promise<Refusal> {
  const data = (await answer.json().catch(() => null)) as { error?: string } | null;
  return new Refusal(answer.status, data?.error ?? `The server answered ${answer.status}.`);
}

function sending(method: string, data: unknown): RequestInit {
  const headers = { "content-type": "application/json" };
  return { method, headers, body: JSON.stringify(data) };
}

const json = async <T>(answer: Promise<Response>): Promise<T> => (await answer).json() as Promise<T>;

const photoPath = (photo: string, what: string) => `/api/photos/${encodeURIComponent(photo)}/${what}`;

export const imageUrl = (photo: string, size: 240 | 1600 | 8192) => photoPath(photo, `image?size=${size}`);

export const facts = () => json<Facts>(demand("/api/project"));

export const hit = (origin: Vec3, direction: Vec3) =>
  json<Hit | null>(demand("/api/hit", sending("POST", { origin, direction })));

export const startJob = (kind: string, more: { photo?: string; place?: number | null } = {}) =>
  json<Job>(demand("/api/jobs", sending("POST", { kind, ...more })));

export const lights = () => json<Lights>(demand("/api/lights"));

/** What the surface is made of; empty where nothing tells. */
export const materials = () => json<Material[]>(demand("/api/materials"));

export const places = () => json<Places>(demand("/api/places"));

export const cancelJob = (id: number) => request(`/api/jobs/${id}`, { method: "DELETE" });

export const picks = (photo: string) => json<SavedPicks>(demand(photoPath(photo, "picks")));

export const fit = (photo: string, list: SavedPick[], without: string[]) =>
  json<Fit>(demand(photoPath(photo, "fit"), sending("POST", { picks: list, without })));

/** error_px: how far off the camera may put a point, one standard deviation. */
export const proposals = (photo: string, camera: Camera, error_px: number, list: SavedPick[]) =>
  json<Proposal[]>(demand(photoPath(photo, "proposals"), sending("POST", { camera, error_px, picks: list })));

export const predict = (photo: string, camera: Camera, given: { uv: Vec2 } | { xyz: Vec3 }) =>
  json<Prediction | null>(demand(photoPath(photo, "predict"), sending("POST", { camera, ...given })));

export const partners = (photo: string) => json<{ photos: string[] }>(demand(photoPath(photo, "partners")));

export const leaveOut = (photo: string, excluded: boolean) => demand(photoPath(photo, "excluded"), sending("PUT", { excluded }));

export const rememberUp = (axis: string) => demand("/api/up", sending("PUT", { axis }));

export const mask = (photo: string) => json<MaskFacts>(demand(photoPath(photo, "mask")));

export const drawMask = (photo: string, stroke: Stroke) =>
  json<MaskFacts>(demand(photoPath(photo, "mask"), sending("POST", stroke)));

/** The mask, black where the photo is never used; null where all of it is. */
export async function maskPicture(photo: string): Promise<ImageBitmap | null> {
  const answer = await demand(photoPath(photo, "mask/picture"));
  return answer.status === 204 ? null : createImageBitmap(await answer.blob());
}

export const settings = () => json<SettingsForm>(demand("/api/settings"));

/** Write changes of the settings of version `base`; `conflict` tells that they had changed meanwhile. */
export async function changeSettings(
  base: string,
  changes: { table: string; key: string; value: SettingValue }[],
): Promise<{ form: SettingsForm; conflict: boolean }> {
  const answer = await request("/api/settings", sending("PATCH", { base, changes }));
  if (!answer.ok && answer.status !== 409) throw await refusalOf(answer);
  return { form: (await answer.json()) as SettingsForm, conflict: answer.status === 409 };
}

/** Save picks edited from version `base`; `conflict` tells that the file had changed meanwhile. */
export async function savePicks(
  photo: string,
  list: SavedPick[],
  base: string,
): Promise<SavedPicks & { conflict: boolean }> {
  const answer = await request(photoPath(photo, "picks"), sending("PUT", { picks: list, base }));
  if (!answer.ok && answer.status !== 409) throw await refusalOf(answer);
  return { ...((await answer.json()) as SavedPicks), conflict: answer.status === 409 };
}

/** A block of arrays; null where the server has none. Layout: texproj/preview/geometry.py. */
export async function pack(path: string): Promise<Pack | null> {
  const answer = await demand(path);
  return answer.status === 204 ? null : unpack(await answer.arrayBuffer());
}

const TYPES = { f4: Float32Array, u4: Uint32Array, u1: Uint8Array, i1: Int8Array };

function unpack(data: ArrayBuffer): Pack {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const arrays: Pack["arrays"] = {};
  for (const [name, entry] of Object.entries<Entry>(header.arrays)) {
    const count = entry.shape.reduce((a, b) => a * b, 1);
    arrays[name] = new TYPES[entry.dtype](data, 4 + length + entry.offset, count);
  }
  return { facts: header, arrays };
}

interface Entry {
  dtype: keyof typeof TYPES;
  shape: number[];
  offset: number;
}

export interface News {
  hello(): void;
  lost(): void;
  job(job: Job): void;
  files(changed: string[]): void;
  light(): void;
}

const PATIENCE_MS = 12000;
const RETRY_MS = 1000;

/** Listen to the server; connects again for ever. Silence is noticed by the missing heartbeat. */
export function listen(news: News): void {
  const source = new EventSource("/api/events");
  const retry = () => {
    source.close();
    news.lost();
    setTimeout(() => listen(news), RETRY_MS);
  };
  let alarm = setTimeout(retry, PATIENCE_MS);
  const on = (kind: string, act: (data: never) => void) =>
    source.addEventListener(kind, (event) => {
      clearTimeout(alarm);
      alarm = setTimeout(retry, PATIENCE_MS);
      act(JSON.parse((event as MessageEvent<string>).data) as never);
    });
  source.onerror = () => {
    clearTimeout(alarm);
    retry();
  };
  on("hello", () => news.hello());
  on("alive", () => undefined);
  on("reload", () => news.hello());
  on("job", (job: Job) => news.job(job));
  on("files", (data: { changed: string[] }) => news.files(data.changed));
  on("light", () => news.light());
}
