// Keeps every error that the page meets.
const errors = [];
addEventListener("error", (e) => errors.push(e.message));
console.error = (m) => errors.push(String(m));
