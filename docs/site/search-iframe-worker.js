// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Browsers start no workers for pages that were opened from a folder. There the search runs in a hidden frame,
// which looks like a worker to the page, and the page like the owner of a worker to the search.
class FrameWorker extends EventTarget {
  constructor(address) {
    super();
    this.onmessage = null;
    this.frame = document.createElement("iframe");
    this.frame.hidden = true;
    document.body.append(this.frame);
    this.loaded = new Promise((resolve, reject) => {
      const inside = this.frame.contentWindow;
      inside.postMessage = (data) => this.answer(data);
      inside.importScripts = async (...scripts) => {
        for (const each of scripts) await FrameWorker.load(inside.document, each);
      };
      FrameWorker.load(inside.document, address).then(resolve, reject);
    });
  }

  static load(page, address) {
    return new Promise((resolve, reject) => {
      const script = page.createElement("script");
      script.addEventListener("load", resolve);
      script.addEventListener("error", () => reject(new Error(`${address} cannot be loaded`)));
      script.src = address;
      page.body.append(script);
    });
  }

  answer(data) {
    const event = new MessageEvent("message", { data });
    this.dispatchEvent(event);
    if (this.onmessage) this.onmessage(event);
  }

  async postMessage(data) {
    await this.loaded;
    const inside = this.frame.contentWindow;
    inside.dispatchEvent(new inside.MessageEvent("message", { data }));
  }

  terminate() {
    this.frame.remove();
  }
}

if (location.protocol === "file:") {
  window.IFrameWorker = FrameWorker; // the search looks for this name to know that it is in a frame
  window.Worker = FrameWorker;
}
