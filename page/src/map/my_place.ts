/** Where the people with this page stand. */

import type { LonLat } from "../shared/geo";
import { t, verbatim } from "../shared/i18n";
import { toast } from "../shared/notice";
import { store } from "../store";

/** Place known to the browser. */
let browsers: LonLat | null = null;
let watching: number | null = null;

/** Where the people stand: by the ground station's own receiver, or else by the browser. */
export function myPlace(): LonLat | null {
  const me = store.state?.me;
  if (me && me.latitude_deg !== null && me.longitude_deg !== null) return [me.longitude_deg, me.latitude_deg];
  return browsers;
}

/** Show where this computer is, as its browser knows it; again to end it. */
export function toggleMe(button: HTMLElement): void {
  if (watching !== null) {
    navigator.geolocation.clearWatch(watching);
    [watching, browsers] = [null, null];
  } else if (!("geolocation" in navigator)) {
    toast(t("tap.no_position"), 5);
    return;
  } else {
    watching = navigator.geolocation.watchPosition(
      (found) => {
        browsers = [found.coords.longitude, found.coords.latitude];
        store.emit("me");
      },
      (fault) => toast(t("tap.position_unknown", { reason: verbatim(fault.message) }), 5),
      { enableHighAccuracy: true, maximumAge: 5000 },
    );
  }
  store.emit("me");
  button.setAttribute("aria-pressed", String(watching !== null));
}
