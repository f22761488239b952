// Requests to the server. Every failure is an Error whose message can be shown as it is.

async function answer(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Error("The server has ended. Start fastgen studio again and open its new address.");
  }
  if (response.ok) return response;
  const text = await response.text();
  let data = {};
  try {
    data = JSON.parse(text);
  } catch {
    data = { error: text.trim() };
  }
  throw Object.assign(new Error(data.error || response.statusText), {
    refused: response.status === 422,
    superseded: response.status === 409,
    gone: response.status === 404,
  });
}

export async function controlsOf(preset) {
  const query = preset === undefined ? "" : `?preset=${encodeURIComponent(preset)}`;
  return (await answer(`controls${query}`)).json();
}

export async function draw(wanted) {
  const body = JSON.stringify(wanted);
  return (await answer("draw", { method: "POST", body })).json();
}

// One layer of a picture; the server sends RGBA, row by row.
export async function layer(number, name, [width, height]) {
  const data = await (await answer(`pictures/${number}/${name}`)).arrayBuffer();
  return createImageBitmap(new ImageData(new Uint8ClampedArray(data), width, height));
}

// Label values of a picture: {ids, damage, background, depth}, one value per pixel, row by row.
export async function pixels(number, count) {
  const data = await (await answer(`pictures/${number}/pixels`)).arrayBuffer();
  const [ids, damage, background] = [0, 1, 2].map(
    (k) => new Uint16Array(data, 2 * k * count, count),
  );
  return { ids, damage, background, depth: new Float32Array(data.slice(6 * count)) };
}
