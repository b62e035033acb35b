// h5web on one page: choose a file, or get it embedded as base64 in <script id="result">.
import '@h5web/app/styles.css';
import { App } from '@h5web/app';
import { H5WasmBufferProvider, H5WasmLocalFileProvider } from '@h5web/h5wasm';
import { useEffect, useState } from 'react';
import { createRoot } from 'react-dom/client';

const embedded = document.getElementById('result');

function Page() {
  const [file, setFile] = useState();
  const [buffer, setBuffer] = useState();
  useEffect(() => {
    if (embedded) {
      fetch(`data:application/octet-stream;base64,${embedded.textContent.trim()}`)
        .then((answer) => answer.arrayBuffer())
        .then(setBuffer);
    }
  }, []);
  if (buffer) {
    return (
      <H5WasmBufferProvider filename={embedded.dataset.name} buffer={buffer}>
        <App />
      </H5WasmBufferProvider>
    );
  }
  if (file) {
    return (
      <H5WasmLocalFileProvider file={file}>
        <App />
      </H5WasmLocalFileProvider>
    );
  }
  if (embedded) return <p>Loading {embedded.dataset.name} ...</p>;
  return (
    <label>
      Result file (.hdf): <input type="file" accept=".hdf,.h5" onChange={(event) => setFile(event.target.files[0])} />
    </label>
  );
}

createRoot(document.getElementById('root')).render(
  <div style={{ height: '100vh' }}>
    <Page />
  </div>,
);
