//! Writes small pickles, for files that break a tool's conventions on purpose.

use serde_json::Value;
use std::path::Path;

/// Writes `value` as a pickle of protocol 2: dictionaries, lists, texts and floats; `null` is NaN.
pub(crate) fn write(path: &Path, value: &Value) {
    std::fs::write(path, bytes(value)).expect("writes");
}

/// The same as numpy's array of one object.
pub(crate) fn write_npy(path: &Path, value: &Value) {
    let text = "{'descr': '|O', 'fortran_order': False, 'shape': (), }";
    let mut file = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    file.extend(format!("{text:<117}\n").as_bytes());
    file.extend(bytes(value));
    std::fs::write(path, file).expect("writes");
}

fn bytes(value: &Value) -> Vec<u8> {
    let mut bytes = vec![0x80, 2];
    push(&mut bytes, value);
    bytes.push(b'.');
    bytes
}

fn push(bytes: &mut Vec<u8>, value: &Value) {
    match value {
        Value::Object(entries) => {
            bytes.extend(b"}(");
            for (key, value) in entries {
                push(bytes, &Value::String(key.clone()));
                push(bytes, value);
            }
            bytes.push(b'u');
        }
        Value::Array(items) => {
            bytes.extend(b"](");
            items.iter().for_each(|item| push(bytes, item));
            bytes.push(b'e');
        }
        Value::String(text) => {
            bytes.push(b'X');
            bytes.extend((text.len() as u32).to_le_bytes());
            bytes.extend(text.as_bytes());
        }
        other => {
            bytes.push(b'G');
            bytes.extend(other.as_f64().unwrap_or(f64::NAN).to_be_bytes());
        }
    }
}
