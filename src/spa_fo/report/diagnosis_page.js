// Draws the experiment that is chosen. `figures` holds them by title, in the page.
"use strict";
const figures = JSON.parse(document.getElementById("figures").textContent);
const chosen = document.getElementById("experiment");

function draw() {
  const { data, layout } = figures[chosen.value];
  const options = { responsive: true, displaylogo: false, displayModeBar: innerWidth > 600 };
  Plotly.react("picture", data, layout, options);
}

chosen.addEventListener("change", draw);
draw();
