/** When this page may command, one vehicle or all: who looks on stops, and does nothing else. */

import { t } from "../shared/i18n";
import { toast } from "../shared/notice";
import { save, unsaved } from "../settings/setup";
import { store } from "../store";

/** Whether a command may go out; says why it may not. Typed tags are saved before they are sent, and none is started without them. */
export async function mayCommand(name: string, showTags: () => void): Promise<boolean> {
  // What runs can always be stopped, whatever is looked at.
  if (name === "stop") return true;
  if (store.looksOn() && name !== "mark") {
    toast(t("common.another_page_commands"), 5);
    return false;
  }
  if (store.review) {
    toast(t("commands.past_flight"), 5);
    return false;
  }
  if (name === "start" && unsaved()) {
    toast(t("commands.tags_unsaved"), 4);
    showTags();
    return false;
  }
  if (name === "send_tags" && unsaved() && !(await save())) {
    toast(t("commands.tags_not_saved"), 4);
    showTags();
    return false;
  }
  return true;
}
