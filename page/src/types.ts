/** Records of the server; docs/reference/ground-api.md describes them. */

export interface SearchRecord {
  tag_id: number;
  /** Share of the time in which no other signal was on the tag's frequency. */
  usable_share: number | null;
  /** ENR of the weakest pulses that would have been found. */
  weakest_enr_db: number | null;
}

export interface PulseRecord {
  tag_id: number;
  start_time_ns: number;
  frequency_hz: number | null;
  snr_db: number | null;
  detection_status: string;
  rate: number;
  latitude_deg: number | null;
  longitude_deg: number | null;
  altitude_relative_m: number | null;
  quaternion_wxyz: [number, number, number, number] | null;
  also_possible_tag_ids: number[];
  ghost_of_tag_id: number | null;
  clipped: boolean;
  received_ns: number;
  flight_id: string | null;
}

/** What is inside a coded tag's burst, which came as a pulse before. */
export interface BurstRecord {
  tag_id: number;
  start_time_ns: number;
  burst_starts_ns: number[];
  burst_snrs_db: number[];
  also_possible_tag_ids: number[];
  flight_id: string | null;
}

export interface PoseRecord {
  time_ns: number;
  age_s: number;
  latitude_deg: number;
  longitude_deg: number;
  altitude_relative_m: number;
  heading_deg: number;
}

export interface ActionState {
  label: string;
  enabled: boolean;
  reason: string | null;
  /** Numbers that the command carries, if the page asks for them. */
  fields?: { name: string; unit: string }[];
}

export interface State {
  time_ns: number;
  version: string;
  connection: { address: string; open: boolean; error: string | null };
  drone: {
    present: boolean;
    system_id: number | null;
    unique_number: string | null;
    /** Other vehicles on this link. */
    others: number[];
    /** Another autopilot answers under the same number. */
    foreign: boolean;
    state: string | null;
    cpu_temperature_c: number | null;
    directory: string | null;
    clock_skew_s: number | null;
  };
  link: {
    loss: number | null;
    round_trip_s: number | null;
    radio: { rssi: number; remote_rssi: number; noise: number; remote_noise: number } | null;
    counters: Record<string, number>;
  };
  vehicle: PoseRecord | null;
  /** The page that commands; null: none does. */
  commander: string | null;
  marks: MarkRecord[];
  /** Take-off position, from the autopilot. */
  home: { latitude_deg: number; longitude_deg: number } | null;
  /** This computer's place by its GPS receiver; null: it has none. */
  me: { latitude_deg: number | null; longitude_deg: number | null; age_s: number | null; error: string | null } | null;
  /** All vehicles that are served, the first first; empty where there is but one. */
  fleet: FleetRecord[];
  armed: boolean | null;
  battery_v: number | null;
  battery_percent: number | null;
  flight: {
    flight_id: string | null;
    start_time_ns: number;
    ended: boolean;
    pulses: number;
    fault: string | null;
  };
  /** Null: the drone says nothing of motion. */
  motion: Motion | null;
  tags_sent: boolean;
  /** What beeps in this flight, listed or not. */
  beeps: BeepRecord[];
  /** Listed tags as a measurement has corrected them. */
  corrections: { tag_id: number; text: string }[];
  /** Offset of all tags, if it is one: the receiver's error. */
  common_ppm: number | null;
  /** Seconds since each detector was heard. */
  detectors: Record<string, number>;
  busy: { action: string; text: string; done: number; whole: number } | null;
  actions: Record<string, ActionState>;
}

/** A sender of pulses that was found without knowing any tag. */
export interface BeepRecord {
  kind: string;
  frequency_hz: number;
  interval_s: number;
  pulses: number;
  level_db: number;
  tag_ids: number[];
  meaning: string;
  /** Something is not as listed. */
  odd: boolean;
  /** Tags of the list that it can correct, and what of them. */
  corrects: { tag_id: number; what: "frequency" | "interval" }[];
}

/** One of several vehicles. */
export interface FleetRecord {
  system_id: number | null;
  name: string;
  /** Where its page is. */
  page: string;
  present: boolean;
  state: string | null;
  pose: PoseRecord | null;
  pulses: number;
}

/** Who flies, and what the drone would fly; places are latitude and longitude. */
export interface Motion {
  standing: "out" | "confirmed" | "in command";
  /** What it does, or why it does not. */
  text: string;
  heard: boolean;
  way: [number, number][];
  offer: { order_id: number; text: string; page: string | null; left_s: number; way: [number, number][] } | null;
}

export type TagRow = Record<string, string | number>;

export interface FieldFault {
  row: number;
  field: string;
  text: string;
}

export interface Settings {
  address: string;
  generation: "G0" | "G1" | "G2v1" | "G2";
  antenna: string;
  antenna_offset_deg: number;
  gain: number | null;
  center_frequency_mhz: number | null;
  /** How far an animal goes in a minute, in steps that forget each other. */
  heading_error_deg: number;
  height_error_m: number;
  roaming_m: number;
  vehicle_name: string;
  /** Address of this computer's GPS receiver; empty: none. */
  my_place: string;
  dem: string;
  /** Tags of the table that are not flown with. */
  left_out: number[];
}

export interface BearingRecord {
  tag_id: number;
  turn: number;
  start_time_ns: number;
  end_time_ns: number;
  turned_deg: number;
  latitude_deg: number;
  longitude_deg: number;
  bearing_deg: number;
  sigma_deg: number | null;
  interval90_deg: [number, number] | null;
  pulses: number;
  accepted: boolean;
  ambiguous: boolean;
  /** Why the arc is as wide as it is. */
  remarks: string[];
  rose_snr_db: (number | null)[];
  /** Estimated on board, from more pulses than have reached the ground. */
  from_drone: boolean;
}

export interface Readout {
  decimal: string;
  dms: string;
  utm: string | null;
  mgrs: string | null;
}

export interface PositionRecord {
  tag_id: number;
  latitude_deg: number;
  longitude_deg: number;
  method: string;
  stations: number;
  /** Pulses whose strength made it, where there are no bearings. */
  powers: number;
  /** When the last was heard that it knows of. */
  end_time_ns: number;
  radius50_m: number | null;
  radius95_m: number | null;
  at_edge: boolean;
  cautions: { name: string; text: string }[];
  /** The cautions' texts, and what became of other receivers. */
  remarks: string[];
  /** Where a tag that moves was, in order of time; empty for one that rests. */
  track: { time_ns: number; latitude_deg: number; longitude_deg: number; radius50_m: number; radius95_m: number }[];
  readout: Readout;
  region50: [number, number][][];
  region95: [number, number][][];
  heat: {
    width: number;
    height: number;
    corners: [[number, number], [number, number], [number, number], [number, number]];
    values: string;
  } | null;
}

export interface Estimates {
  bearings: BearingRecord[];
  positions: PositionRecord[];
}

export interface LogLine {
  number?: number;
  time_ns: number;
  severity: number;
  text: string;
  source: string;
}

export interface FlightSummary {
  flight_id: string;
  start_time_ns: number;
  end_time_ns: number;
  pulses: number;
  tags: { tag_id: number; name: string | null; frequency_hz: number }[];
  source: string;
  starred: boolean;
  /** Number and name of its vehicle, where they are known. */
  vehicle: string | null;
}

export interface ArchivedFlight {
  flight: string;
  path: string;
  start_time_ns: number | null;
  end_time_ns: number | null;
  /** Confirmed ones. */
  pulses: number;
  /** Tag and pulses. */
  heard: [number, number][];
  /** It is on this computer, too. */
  here: boolean;
}

export interface ArchiveAnswer {
  directory: string | null;
  total: number;
  flights: ArchivedFlight[];
}

export interface Choices {
  ports: { device: string; description: string; address: string }[];
  antennas: Record<string, { e_plane_db: number[] | null }>;
  presets: Record<string, string | number>[];
  maps: MapFile[];
  maps_directory: string;
  exports: string[];
}

export interface MapFile {
  name: string;
  fault: string | null;
  format?: "pmtiles" | "mbtiles";
  tiles?: string;
  min_zoom?: number;
  max_zoom?: number;
  bounds?: [number, number, number, number];
  attribution?: string | null;
}

export interface Download {
  flight_id: string;
  file: string;
  done_bytes: number;
  whole_bytes: number | null;
  ended: boolean;
  error: string | null;
}

/** A stretch of a waterfall; values are bytes in base64, column after column. */
export interface WaterfallRecord {
  start_time_ns: number;
  column_s: number;
  low_hz: number;
  high_hz: number;
  columns: number;
  rows: number;
  values: string;
}

/** A place that the operator has marked. */
export interface MarkRecord {
  time_ns: number;
  latitude_deg: number;
  longitude_deg: number;
  text: string;
}

/** What a whole flight's samples say of one tag (uavrt integrate). */
/** A label and its values, in the server's words. */
type FactRow = [string, string[]];

export interface Verdict {
  tag_id: number;
  found: boolean;
  false_alarm_probability: number;
  interval_s: number;
  bearing_deg: number | null;
  arc95_deg: number | null;
  latitude_deg: number | null;
  longitude_deg: number | null;
  radius95_m: number | null;
  places: number;
  pulses: number;
  heard_live: number;
  remarks: string;
  /** The places that the flight cannot distinguish, the likeliest first. */
  parts: { latitude_deg: number; longitude_deg: number; radius95_m: number; probability: number }[];
  /** Latitudes and longitudes around its parts. */
  region95: [number, number][][];
  /** Map of a search without detection; null if the tag was detected. */
  silent: { tag_power_dbm: number; probability: number; within_m: number | null; whole_flight: boolean } | null;
  /** The result as a small table; details help no decision in the field. */
  facts: { rows: FactRow[]; details: FactRow[] };
}

export interface Hindsight {
  tags: Verdict[];
  pulses: { tag_id: number; time_ns: number; longitude_deg: number; latitude_deg: number }[];
}

/** How far uavrt integrate is with a flight. */
export type IntegrationAnswer = { state: "working"; flight: string | null } | { state: "done" } | { state: "failed"; error: string };

/** A flight folded at the interval of each tag, by its number; PNG, base64. */
export type Folds = Record<string, { picture: string; interval_s: number }>;

/** Where a tag is heard (uavrt coverage). */
export interface HeardMap {
  corners: [[number, number], [number, number], [number, number], [number, number]];
  /** PNG, base64. */
  picture: string;
  mean_probability: number | null;
  share_above_90: number | null;
  known_km2: number;
  limitations: string[];
}

/** In a past flight. */
export interface SilenceMap extends HeardMap {
  heard_pulses: number;
  noise: string;
}

/** Along a plan: the best of its heights. */
export interface PlanMap extends HeardMap {
  height_m: number;
  heights: { height_m: number; mean_probability: number | null; best: boolean }[];
  speed_m_s: number;
  cell_m: number;
  antenna: string;
}

export type MapAnswer<Made extends HeardMap> = { state: "working"; done: number } | { state: "failed"; error: string } | ({ state: "done" } & Made);

export interface Absence {
  prior: number;
  heard: number;
  not_here: number;
}

/** An item of the list before a first flight. */
export interface Finding {
  what: string;
  ok: boolean;
  text: string;
  /** What to do; empty where all is in order. */
  remedy: string;
  /** Not known yet; does not stop the start. */
  open: boolean;
}

/** All flights in numbers (uavrt season). */
export interface SeasonRecord {
  flights: number;
  minutes: number;
  animals_heard: number;
  minutes_per_animal: number | null;
  batteries: number;
  batteries_used: number;
  flights_without_battery: number;
  animals: {
    tag_id: number;
    name: string | null;
    frequency_hz: number;
    flights: number;
    flights_heard: number;
    minutes: number;
    minutes_to_hear: number | null;
    last_heard_ns: number | null;
  }[];
}

/** A way to this page from another screen. */
export interface Door {
  what: string;
  text: string;
  /** A QR code, as a data address. */
  picture: string;
}

/** What the first set-up of the drone's computer begins with. */
export interface SetUp {
  wanted: boolean;
  done: string[];
  values: {
    name: string;
    antenna: string;
    yaw_offset_deg: number;
    kind: string;
    gain: number | null;
    sample_rate_msps: number;
    bias_tee: boolean;
    address: string;
    command_key: boolean;
    update_key: boolean;
  };
  choices: {
    antennas: string[];
    radios: { kind: string; title: string; gains: [number, number]; rate_msps: number }[];
    plugged_in: string[];
  };
}
