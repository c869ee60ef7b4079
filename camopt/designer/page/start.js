// Transport of the page's messages, to a server of this machine or to a notebook's kernel, and start of the page.
async function overHttp(message) {
  const reply = await fetch("/ask", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(message) });
  const content = await reply.json();
  if (!reply.ok) throw { says: content.says };
  return content;
}
function overKernel(model) { // messages to a notebook's kernel, numbered so that each reply finds its message
  const waiting = new Map();
  let number = 0;
  model.on("msg:custom", ({ number: at, reply, says }) => {
    const { resolve, reject } = waiting.get(at) ?? {};
    waiting.delete(at);
    if (says) reject?.({ says });
    else resolve?.(reply);
  });
  return (message) => new Promise((resolve, reject) => {
    number += 1;
    waiting.set(number, { resolve, reject });
    model.send({ number, message });
  });
}
function render({ model, el }) {
  const root = h("div", { class: "camopt-live notebook" });
  el.append(root);
  new Designer(root, overKernel(model)).begin();
}
const served = document.getElementById("camopt-live");
if (served) new Designer(served, overHttp, () => fetch("/alive")).begin();
export default { render };
