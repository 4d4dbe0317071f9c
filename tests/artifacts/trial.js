// Uses the page as a person would, and leaves what it found in it.
const found = {},
  arm = document.getElementById("arm"),
  slider = document.getElementById("time");
const picture = () => arm.toDataURL();
const rows = [...document.querySelectorAll("tr[data-motion]")];
found.ready = document.body.dataset.ready;
found.tip = [arm.dataset.tip];
const before = picture();
slider.value = 1;
slider.dispatchEvent(new Event("input"));
found.moved = picture() !== before;
found.tip.push(arm.dataset.tip);
found.marker = [...document.querySelectorAll(".now")].map((line) => parseFloat(line.style.left) > 0);
found.plots = [...document.querySelectorAll(".plot h3")].map((head) => head.textContent);
found.ink = [...document.querySelectorAll(".plot canvas")].every((c) =>
  c
    .getContext("2d")
    .getImageData(0, 0, c.width, c.height)
    .data.some((v) => v),
);
rows[2].click();
found.chosen = [
  rows.findIndex((row) => row.classList.contains("focus")),
  document.querySelector(".plot h3").textContent,
];
const all = picture();
rows[1].querySelector("input").click();
found.hidden = picture() !== all;
const select = document.getElementById("joint");
select.value = "1";
select.dispatchEvent(new Event("change"));
found.one = document.querySelector(".plot h3").textContent;
const over = document.querySelector("#plane .u-over"),
  box = over.getBoundingClientRect();
const click = new MouseEvent("click", { clientX: box.left + (0.08 / 1.16) * box.width, clientY: 0, bubbles: true });
for (let y = 2; y < box.height; y += 10)
  over.dispatchEvent(new MouseEvent("click", { clientX: click.clientX, clientY: box.top + y, bubbles: true }));
found.byPoint = rows.map((row) => row.querySelector("input").checked);
found.errors = errors;
const told = document.createElement("pre");
told.id = "found";
told.textContent = JSON.stringify(found);
document.body.append(told);
