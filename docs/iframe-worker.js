// A page that was opened from the disk may start no worker: its search runs in a hidden frame in the worker's place.
class FrameWorker extends EventTarget {
  constructor(url) {
    super();
    this.frame = document.createElement("iframe");
    this.frame.hidden = true;
    this.frame.addEventListener("answer", ({ data }) => this.dispatchEvent(new MessageEvent("message", { data })));
    document.body.appendChild(this.frame);
    const answer = 'window.postMessage = (data) => frameElement.dispatchEvent(new MessageEvent("answer", { data }))';
    const inside = this.frame.contentWindow;
    inside.document.open();
    inside.document.write(`<body><script>${answer}</` + `script><script src="${url}"></` + "script></body>");
    inside.document.close();
    this.ready = new Promise((done) => inside.addEventListener("load", done));
  }
  postMessage(data) {
    this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
  }
  terminate() {
    this.frame.remove();
  }
}

if (location.protocol === "file:") window.Worker = FrameWorker;
