// h5web on one page: choose a result file and it opens.
import '@h5web/app/styles.css';
import { App } from '@h5web/app';
import { H5WasmLocalFileProvider } from '@h5web/h5wasm';
import { useState } from 'react';
import { createRoot } from 'react-dom/client';

function Page() {
  const [file, setFile] = useState();
  if (file) {
    return (
      <H5WasmLocalFileProvider file={file}>
        <App />
      </H5WasmLocalFileProvider>
    );
  }
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
