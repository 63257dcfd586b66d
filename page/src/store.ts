/**
 * All that the page knows. The server is the only memory: after a reload, in a second browser or
 * after a restart of the server the same is fetched again.
 */

import { BASE, columns, get, PAGE, reasonOf } from "./shared/api";
import { t, verbatim, type Words } from "./shared/i18n";
import { toast } from "./shared/notice";
import { PULSE_NAMES, Pulses } from "./shared/pulses";
import { emptyTrack, extend, MOST_POSES, POSE_NAMES, type Track, trackFrom } from "./shared/vehicle_track";
import type {
  BearingRecord,
  Download,
  Estimates,
  Folds,
  Hindsight,
  FlightSummary,
  LogLine,
  MarkRecord,
  PoseRecord,
  PositionRecord,
  BurstRecord,
  PulseRecord,
  SearchRecord,
  Settings,
  State,
  TagRow,
  WaterfallRecord,
} from "./types";

export type Topic =
  | "state"
  | "me"
  | "tags"
  | "settings"
  | "pulses"
  | "reset"
  | "track"
  | "pose"
  | "estimates"
  | "log"
  | "selection"
  | "other"
  | "download"
  | "hindsight"
  | "waterfall"
  | "online";

/** A flight as it lies on the server's disk. */
export interface Stored extends Estimates {
  summary: FlightSummary & {
    rows: TagRow[];
    log: LogLine[];
    home: { latitude_deg: number; longitude_deg: number } | null;
    marks: MarkRecord[];
  };
  pulses: Pulses;
  track: Track;
}

const RECONNECT_MS = 1000;
/** The state comes every second: a station that is silent for so long stands still. */
const SILENT_MS = 4000;
/** Radius of 95 % of a round normal distribution, in standard deviations along one axis. */
const SHARE95 = Math.sqrt(-2 * Math.log(0.05)) / Math.SQRT2;

/** Whether a position stands: one bearing gives but a wedge; a monopole gives none. */
export function isPlaced(one: PositionRecord): boolean {
  return one.stations > 1 || (one.powers ?? 0) > 0;
}

class Store {
  online = false;
  state: State | null = null;
  tags: TagRow[] = [];
  /** Names the content of the table, so that two pages do not overwrite each other. */
  tagsVersion = "";
  settings: Settings | null = null;
  log: LogLine[] = [];
  pulses = new Pulses();
  /** The last burst of each coded tag, with the pulses in it. */
  bursts = new Map<number, BurstRecord>();
  /** The newest report of each tag's search. */
  searched = new Map<number, SearchRecord>();
  bearings: BearingRecord[] = [];
  positions: PositionRecord[] = [];
  track: Track = emptyTrack();
  pose: PoseRecord | null = null;
  /** Flight that is looked at: null is the live one. */
  review: Stored["summary"] | null = null;
  /** Flight that is compared with it. */
  other: Stored | null = null;
  /** What a whole flight's samples say of the flight that is looked at. */
  hindsight: Hindsight | null = null;
  folds: Folds = {};
  download: Download | null = null;
  /** Columns of the live waterfall that are not drawn yet. */
  waterfall: WaterfallRecord[] = [];
  /** Replay: nothing later than this is shown. */
  until = Infinity;
  selected: number | null = null;
  hidden = new Set<number>();
  /** Only pulses heard between these heights are shown [m above the start]; null: all. */
  heights: [number, number] | null = null;

  private listeners = new Map<Topic, Set<() => void>>();
  private due = new Set<Topic>();
  private offsetMs = 0;
  private liveFlight: string | null = null;
  /** Estimates of the live flight, which come also while a past one is shown. */
  private estimated: Estimates = { bearings: [], positions: [] };
  private waiting: PulseRecord[] | null = null;
  /** The newest of the requests for the live flight, and for a past one: earlier answers come too late. */
  private loading = 0;
  private opening = 0;

  on(topics: Topic[], listener: () => void): void {
    for (const topic of topics) {
      if (!this.listeners.has(topic)) this.listeners.set(topic, new Set());
      this.listeners.get(topic)!.add(listener);
    }
  }

  /** Notify the listeners, once for each frame of the screen. */
  emit(topic: Topic): void {
    if (this.due.size === 0) {
      // A hidden tab draws no frames; what it shows when it comes back must be right.
      const run = () => this.flush();
      if (document.hidden) setTimeout(run, 50);
      else requestAnimationFrame(run);
    }
    this.due.add(topic);
  }

  private flush(): void {
    const topics = [...this.due];
    this.due.clear();
    const called = new Set<() => void>();
    for (const topic of topics) {
      for (const listener of this.listeners.get(topic) ?? []) {
        if (!called.has(listener)) {
          called.add(listener);
          listener();
        }
      }
    }
  }

  /** The server's clock now, whatever this computer's says [ns]. */
  nowNs(): number {
    if (this.review) return Math.min(this.until, this.review.end_time_ns);
    return (Date.now() + this.offsetMs) * 1e6;
  }

  /** The drone's clock now: times of pulses compare with it [ns]. */
  pulseNowNs(): number {
    if (this.review) return this.nowNs();
    return this.nowNs() - (this.state?.drone.clock_skew_s ?? 0) * 1e9;
  }

  /** Whether another page commands, and this one only looks on. */
  looksOn(): boolean {
    const commander = this.state?.commander ?? null;
    return commander !== null && commander !== PAGE;
  }

  marks(): MarkRecord[] {
    return this.review ? this.review.marks : (this.state?.marks ?? []);
  }

  /** Seconds since what a tag's position was made of, now or at the replay's time; null: there is none. */
  age(id: number): number | null {
    const fix = this.positions.find((one) => one.tag_id === id);
    return fix ? Math.max(0, (this.pulseNowNs() - fix.end_time_ns) / 1e9) : null;
  }

  /** A position's radius as it is by now: an animal that roams is less sure every minute. */
  radiusNow(fix: PositionRecord): number | null {
    if (fix.radius95_m === null) return null;
    const minutes = (this.age(fix.tag_id) ?? 0) / 60;
    return Math.hypot(fix.radius95_m, SHARE95 * (this.settings?.roaming_m ?? 0) * Math.sqrt(minutes));
  }

  tagRows(): TagRow[] {
    return this.review ? this.review.rows : this.tags;
  }

  tagName(id: number): Words {
    const row = this.tagRows().find((one) => Number(one.id) === id);
    const name = row ? String(row.name ?? "") : "";
    return verbatim(name ? `${id} ${name}` : id);
  }

  tagOrder(id: number): number {
    const place = this.tagRows().findIndex((one) => Number(one.id) === id);
    return place >= 0 ? place : id;
  }

  flightId(): string | null {
    return this.review ? this.review.flight_id : (this.state?.flight.flight_id ?? null);
  }

  select(id: number | null): void {
    this.selected = id;
    this.emit("selection");
  }

  setHeights(heights: [number, number] | null): void {
    this.heights = heights;
    this.emit("selection");
  }

  /** Whether what was heard at a height is shown. */
  within(heightM: number): boolean {
    return this.heights === null || (heightM >= this.heights[0] && heightM < this.heights[1]);
  }

  toggle(id: number): void {
    if (this.hidden.has(id)) this.hidden.delete(id);
    else this.hidden.add(id);
    this.emit("selection");
  }

  seek(timeNs: number): void {
    this.until = timeNs;
    this.emit("selection");
    this.emit("estimates");
  }

  /** How many pulses are shown: all, or those up to the replay's time. */
  shown(): number {
    if (!Number.isFinite(this.until)) return this.pulses.count;
    const time = this.pulses.get("time");
    let low = 0;
    let high = this.pulses.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (time[middle]! <= this.until) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Positions that stand: one bearing gives a wedge, and in a replay all turns must be flown. */
  placed(): PositionRecord[] {
    const last = Math.max(...this.bearings.map((one) => one.end_time_ns), 0);
    return this.positions.filter((one) => isPlaced(one) && this.until >= Math.max(last, one.end_time_ns));
  }

  // ---------------------------------------------------------------- past flights

  /** Load a past flight and show it; false where another was opened meanwhile. */
  async open(flightId: string): Promise<boolean> {
    const ticket = ++this.opening;
    const { summary, pulses, track } = await flightOf(flightId);
    if (ticket !== this.opening) return false;
    this.review = summary;
    this.until = Infinity;
    // Chosen now and not by the list of tags, which would have all of it drawn once more.
    this.selected = Number(summary.rows[0]?.id ?? NaN) || null;
    this.hidden.clear();
    this.heights = null;
    this.other = null;
    this.hindsight = null;
    this.pulses = pulses;
    this.track = track;
    this.take({ bearings: [], positions: [] });
    this.emit("other");
    this.pose = null;
    this.waiting = null;
    this.emit("reset");
    this.emit("state");
    void this.loadEstimates(flightId, ticket);
    void this.loadHindsight(flightId, ticket);
    return true;
  }

  /** Ask again what the whole flight that is shown said. */
  async hindsightAgain(): Promise<void> {
    if (this.review) await this.loadHindsight(this.review.flight_id, this.opening);
  }

  private async loadHindsight(flightId: string, ticket: number): Promise<void> {
    const found = await get<Hindsight>(`/flights/${encodeURIComponent(flightId)}/integrated`).catch(() => null);
    if (ticket !== this.opening) return;
    this.hindsight = found;
    this.folds = {};
    this.emit("hindsight");
    if (!found?.tags.length) return;
    const folds = await get<Folds>(`/flights/${encodeURIComponent(flightId)}/folds`).catch(() => ({}));
    if (ticket !== this.opening) return;
    this.folds = folds;
    this.emit("hindsight");
  }

  private async loadEstimates(flightId: string, ticket: number): Promise<void> {
    try {
      const found = await estimatesOf(flightId);
      if (ticket === this.opening) this.take(found);
    } catch (error) {
      if (ticket === this.opening) toast(t("store.no_estimates", { reason: reasonOf(error) }), 3);
    }
  }

  /** Lay another flight over the one that is shown. */
  compare(other: Stored | null): void {
    this.other = other;
    this.emit("other");
  }

  backToLive(): void {
    ++this.opening;
    this.review = null;
    this.hindsight = null;
    this.emit("hindsight");
    this.compare(null);
    this.until = Infinity;
    this.take(this.estimated);
    void this.loadLive();
  }

  // ---------------------------------------------------------------- live

  connect(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}${BASE}/api/records?page=${PAGE}`);
    let silence = 0;
    socket.onmessage = (event) => {
      clearTimeout(silence);
      silence = window.setTimeout(() => this.setOnline(false), SILENT_MS);
      this.receive(JSON.parse(String(event.data)));
    };
    socket.onclose = () => {
      clearTimeout(silence);
      this.setOnline(false);
      setTimeout(() => this.connect(), RECONNECT_MS);
    };
  }

  private setOnline(online: boolean): void {
    if (this.online === online) return;
    this.online = online;
    this.emit("online");
  }

  private receive(message: { topic: string; record: unknown }): void {
    switch (message.topic) {
      case "hello": {
        const hello = message.record as {
          state: State;
          tags: TagRow[];
          tags_version: string;
          settings: Settings;
          log: LogLine[];
          download: Download | null;
        } & Estimates;
        this.online = true;
        this.takeState(hello.state);
        this.tags = hello.tags;
        this.tagsVersion = hello.tags_version;
        this.settings = hello.settings;
        this.log = hello.log;
        this.download = hello.download;
        this.estimated = hello;
        if (!this.review) {
          this.take(hello);
          void this.loadLive();
        }
        for (const topic of ["online", "tags", "settings", "log", "download"] as const) this.emit(topic);
        break;
      }
      case "state":
        this.setOnline(true);
        this.takeState(message.record as State);
        break;
      case "tags_version":
        // The state after this is the first that speaks of the new table.
        if (this.state) this.state.tags_sent &&= this.tagsVersion === message.record;
        this.tagsVersion = String(message.record);
        break;
      case "tags":
        this.tags = message.record as TagRow[];
        this.emit("tags");
        break;
      case "settings":
        this.settings = message.record as Settings;
        this.emit("settings");
        break;
      case "log":
        this.log.push(message.record as LogLine);
        if (this.log.length > 2000) this.log.splice(0, 500);
        this.emit("log");
        break;
      case "flight":
        this.liveFlight = null;
        if (!this.review) void this.loadLive();
        break;
      case "pulse":
        this.takePulse(message.record as PulseRecord);
        break;
      case "search": {
        const report = message.record as SearchRecord;
        this.searched.set(report.tag_id, report);
        break;
      }
      case "burst":
        this.takeBurst(message.record as BurstRecord);
        break;
      case "pose":
        this.takePose(message.record as PoseRecord);
        break;
      case "download":
        this.download = message.record as Download;
        this.emit("download");
        break;
      case "waterfall":
        this.waterfall.push(message.record as WaterfallRecord);
        if (this.waterfall.length > 600) this.waterfall.shift();
        this.emit("waterfall");
        break;
      case "estimates": {
        const record = message.record as Estimates & { flight_id: string };
        if (record.flight_id !== this.state?.flight.flight_id) break;
        this.estimated = record;
        if (!this.review) this.take(record);
        break;
      }
    }
  }

  private takeState(state: State): void {
    this.state = state;
    this.offsetMs = state.time_ns / 1e6 - Date.now();
    if (state.vehicle && !this.review) this.pose = state.vehicle;
    this.emit("state");
  }

  private takePulse(record: PulseRecord): void {
    if (this.review) return;
    if (this.waiting) {
      this.waiting.push(record);
      return;
    }
    if (record.flight_id !== this.liveFlight) {
      void this.loadLive();
      return;
    }
    if (this.pulses.add(record)) this.emit("pulses");
  }

  private takeBurst(record: BurstRecord): void {
    this.bursts.set(record.tag_id, record);
    const also = record.also_possible_tag_ids[0];
    if (!this.review && also !== undefined) this.pulses.doubt(record.tag_id, record.start_time_ns, also);
    this.emit("pulses");
  }

  private takePose(pose: PoseRecord): void {
    if (this.review) return;
    this.pose = pose;
    if (this.state && !this.state.flight.ended) extend(this.track, pose);
    this.emit("pose");
  }

  private take(found: Estimates): void {
    this.bearings = found.bearings;
    this.positions = found.positions;
    this.emit("estimates");
  }

  /** Fetch the live flight as it is; what comes meanwhile is added afterwards, once. */
  private async loadLive(): Promise<void> {
    const ticket = ++this.loading;
    this.waiting = [];
    const state = await get<State>("/state").catch(() => null);
    const id = state?.flight.flight_id ?? null;
    let pulses = new Pulses();
    let track = emptyTrack();
    if (id !== null) {
      try {
        [pulses, track] = await Promise.all([pulsesOf(`/flights/${id}`), trackOf(`/flights/${id}`)]);
      } catch {
        // The flight is not on the disk yet; its pulses come one by one.
      }
    }
    if (ticket !== this.loading || this.review) return;
    const waiting = this.waiting ?? [];
    this.waiting = null;
    if (id !== this.liveFlight) {
      this.heights = null;
      this.bursts.clear();
    }
    this.liveFlight = id;
    this.pulses = pulses;
    this.track = track;
    for (const record of waiting) if (record.flight_id === id) this.pulses.add(record);
    if (id === null) this.take({ bearings: [], positions: [] });
    this.emit("reset");
  }
}

async function flightOf(flightId: string): Promise<Omit<Stored, keyof Estimates>> {
  const path = `/flights/${encodeURIComponent(flightId)}`;
  const [summary, pulses, track] = await Promise.all([get<Stored["summary"]>(path), pulsesOf(path), trackOf(path)]);
  return { summary, pulses, track };
}

async function pulsesOf(path: string): Promise<Pulses> {
  return Pulses.from(await columns(`${path}/columns`, PULSE_NAMES));
}

async function trackOf(path: string): Promise<Track> {
  return trackFrom(await columns(`${path}/track`, POSE_NAMES, `&most=${MOST_POSES}`));
}

function estimatesOf(flightId: string): Promise<Estimates> {
  return get<Estimates>(`/flights/${encodeURIComponent(flightId)}/estimates`);
}

export async function stored(flightId: string): Promise<Stored> {
  const [flight, found] = await Promise.all([flightOf(flightId), estimatesOf(flightId)]);
  return { ...flight, ...found };
}

export const store = new Store();
