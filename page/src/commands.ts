/** When this page may command, one vehicle or all: who looks on stops, and does nothing else. */

import { toast } from "./notice";
import { save, unsaved } from "./setup";
import { store } from "./store";

/** Whether a command may go out; says why it may not. Typed tags are saved before they are sent, and none is started without them. */
export async function mayCommand(name: string, showTags: () => void): Promise<boolean> {
  // What runs can always be stopped, whatever is looked at.
  if (name === "stop") return true;
  if (store.looksOn() && name !== "mark") {
    toast("Another page has command. Take command first", 5);
    return false;
  }
  if (store.review) {
    toast("This is a past flight. Go back to the live flight first", 5);
    return false;
  }
  if (name === "start" && unsaved()) {
    toast("The edited tags are not saved and not sent. Send the tags first", 4);
    showTags();
    return false;
  }
  if (name === "send_tags" && unsaved() && !(await save())) {
    toast("The edited tags could not be saved, so nothing was sent. See Set-up", 4);
    showTags();
    return false;
  }
  return true;
}
