// The search runs in a worker, which browsers refuse to pages that are opened as files. There, a
// hidden frame does its work: it loads the same script, and hands messages on.
class FrameWorker extends EventTarget {
  constructor(url) {
    super();
    this.onmessage = null;
    this.frame = document.createElement("iframe");
    this.frame.hidden = true;
    this.frame.srcdoc = `<!doctype html><script>
      globalThis.postMessage = (data) => parent.postMessage({ worker: "${url}", data }, "*");
      globalThis.importScripts = (...addresses) => addresses.reduce((before, address) =>
        before.then(() => new Promise((resolve, reject) => {
          const script = document.createElement("script");
          Object.assign(script, { src: address, onload: resolve, onerror: reject });
          document.body.append(script);
        })), Promise.resolve());
    </script><body><script src="${url}"></script>`;
    this.ready = new Promise((resolve) => this.frame.addEventListener("load", resolve));
    window.addEventListener("message", (event) => {
      if (event.data?.worker === url) {
        const message = new MessageEvent("message", { data: event.data.data });
        this.dispatchEvent(message);
        this.onmessage?.(message);
      }
    });
    const add = () => document.body.append(this.frame);
    if (document.body) add();
    else document.addEventListener("DOMContentLoaded", add);
  }

  postMessage(data) {
    this.ready.then(() => {
      const target = this.frame.contentWindow;
      target.dispatchEvent(new target.MessageEvent("message", { data }));
    });
  }

  terminate() {
    this.frame.remove();
  }
}

if (location.protocol === "file:") globalThis.Worker = FrameWorker;
