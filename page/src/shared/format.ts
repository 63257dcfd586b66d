/** Numbers and times as people read them. */

import { t, verbatim, type Words } from "./i18n";

export const UNKNOWN = verbatim("–");

export function fixed(value: number | null | undefined, digits: number, unit = ""): Words {
  if (value === null || value === undefined || !Number.isFinite(value)) return UNKNOWN;
  return verbatim(value.toFixed(digits) + (unit ? `\u202f${unit}` : ""));
}

export function clock(timeNs: number): Words {
  return verbatim(new Date(timeNs / 1e6).toISOString().slice(11, 19));
}

export function dateTime(timeNs: number): Words {
  return verbatim(`${new Date(timeNs / 1e6).toISOString().slice(0, 16).replace("T", " ")} UTC`);
}

export function span(seconds: number): Words {
  if (!Number.isFinite(seconds) || seconds < 0) return UNKNOWN;
  const whole = Math.round(seconds);
  const parts = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const texts = (parts[0] ? parts : parts.slice(1)).map((part, place) =>
    place === 0 ? String(part) : String(part).padStart(2, "0"),
  );
  return verbatim(texts.join(":"));
}

export function ago(seconds: number): Words {
  if (seconds < 60) return t("format.seconds_ago", { seconds: Math.max(0, Math.round(seconds)) });
  if (seconds < 5400) return t("format.minutes_ago", { minutes: Math.round(seconds / 60) });
  return t("format.hours_ago", { hours: Math.round(seconds / 3600) });
}

export function metres(value: number | null): Words {
  if (value === null) return UNKNOWN;
  return value < 1000 ? fixed(Math.round(value), 0, "m") : fixed(value / 1000, 2, "km");
}

/** A share in whole percent. */
export function percent(share: number): Words {
  return fixed(100 * share, 0, "%");
}

/** Name of a vehicle; its number if it has none. */
export function vehicleName(one: { name: string; system_id: number | null }): Words {
  return one.name ? verbatim(one.name) : t("vehicles.vehicle", { number: verbatim(one.system_id ?? "?") });
}
