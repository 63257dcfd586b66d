/** Numbers and times as people read them. */

export const UNKNOWN = "–";

export function fixed(value: number | null | undefined, digits: number, unit = ""): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return UNKNOWN;
  return value.toFixed(digits) + (unit ? `\u202f${unit}` : "");
}

export function clock(timeNs: number): string {
  return new Date(timeNs / 1e6).toISOString().slice(11, 19);
}

export function dateTime(timeNs: number): string {
  return new Date(timeNs / 1e6).toISOString().slice(0, 16).replace("T", " ") + " UTC";
}

export function span(seconds: number): string {
  if (!Number.isFinite(seconds) || seconds < 0) return UNKNOWN;
  const whole = Math.round(seconds);
  const parts = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const texts = (parts[0] ? parts : parts.slice(1)).map((part, place) =>
    place === 0 ? String(part) : String(part).padStart(2, "0"),
  );
  return texts.join(":");
}

export function ago(seconds: number): string {
  if (seconds < 60) return `${Math.max(0, Math.round(seconds))}\u202fs ago`;
  if (seconds < 5400) return `${Math.round(seconds / 60)}\u202fmin ago`;
  return `${Math.round(seconds / 3600)}\u202fh ago`;
}

export function metres(value: number | null): string {
  if (value === null) return UNKNOWN;
  return value < 1000 ? `${Math.round(value)}\u202fm` : `${(value / 1000).toFixed(2)}\u202fkm`;
}
