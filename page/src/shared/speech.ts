/** Speech by the browser's own voice, which works without a network. */

import { language, type Words } from "./i18n";

let enabled = false;

export function speaking(): boolean {
  return enabled;
}

export function setSpeaking(on: boolean): void {
  enabled = on;
  if (!on) window.speechSynthesis?.cancel();
}

export function speak(text: Words): void {
  if (!("speechSynthesis" in window)) return;
  const words = new SpeechSynthesisUtterance(text);
  words.lang = language;
  // A voice of a service would send the text away.
  const voice = speechSynthesis.getVoices().find((one) => one.localService && one.lang.startsWith(language));
  if (!voice && speechSynthesis.getVoices().length) return;
  if (voice) words.voice = voice;
  speechSynthesis.speak(words);
}
