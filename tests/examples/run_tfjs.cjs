// Writes the values of nodes of a graph model, by TensorFlow.js, for a picture of float32 values.
// node run_tfjs.cjs GRAPH WEIGHTS PICTURE SIDE OUTPUT NODE...: writes OUTPUT.0, OUTPUT.1, ...
const fs = require("fs");
const tf = require("@tensorflow/tfjs");

const [graph, weights, picture, side, output, ...nodes] = process.argv.slice(2);
const bytes = (path) => {
  const body = fs.readFileSync(path);
  return body.buffer.slice(body.byteOffset, body.byteOffset + body.byteLength);
};

(async () => {
  await tf.setBackend("cpu");
  const model = JSON.parse(fs.readFileSync(graph));
  const network = await tf.loadGraphModel({
    load: async () => ({
      modelTopology: model.modelTopology,
      signature: model.signature,
      weightSpecs: model.weightsManifest.flatMap((group) => group.weights),
      weightData: bytes(weights),
    }),
  });
  const found = network.execute(tf.tensor4d(new Float32Array(bytes(picture)), [1, +side, +side, 3]), nodes);
  [found].flat().forEach((tensor, k) => fs.writeFileSync(`${output}.${k}`, Buffer.from(tensor.dataSync().buffer)));
})();
