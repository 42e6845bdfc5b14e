//! Sizes of the parts of a checkpoint, from the header of its weights file, without reading any
//! tensor.

use crate::avatar::PartCount;
use crate::train::TrainError;
use serde::Deserialize;
use serde_json::{Map, Value};
use std::io::Read;
use std::path::Path;
use yoto_proto::manifest::files;

/// Longest header that is read, bytes. A model of a thousand identities needs less than one MiB.
const MAX_HEADER: u64 = 64 << 20;

/// A tensor in the header.
#[derive(Deserialize)]
struct Entry {
    shape: Vec<u64>,
    data_offsets: [u64; 2],
}

/// Parameters and bytes of each part of the weights in the folder `dir`, largest first.
///
/// # Errors
/// If the file is missing or its header is invalid.
pub fn read_parts(dir: &Path) -> Result<Vec<PartCount>, TrainError> {
    let path = dir.join(files::WEIGHTS);
    let failed = |message: String| TrainError::File {
        file: path.display().to_string(),
        message,
    };
    let mut file = std::fs::File::open(&path).map_err(|e| failed(e.to_string()))?;
    let mut head = [0u8; 8];
    file.read_exact(&mut head)
        .map_err(|e| failed(e.to_string()))?;
    let length = u64::from_le_bytes(head);
    if length > MAX_HEADER {
        return Err(failed(format!("a header of {length} bytes")));
    }
    let mut header = Vec::new();
    file.take(length)
        .read_to_end(&mut header)
        .map_err(|e| failed(e.to_string()))?;
    let header: Map<String, Value> =
        serde_json::from_slice(&header).map_err(|e| failed(e.to_string()))?;
    let mut parts: Vec<PartCount> = Vec::new();
    for (name, value) in header {
        // Not a tensor.
        if name == "__metadata__" {
            continue;
        }
        let entry: Entry =
            serde_json::from_value(value).map_err(|e| failed(format!("{name}: {e}")))?;
        let part = name.split_once('.').map_or(name.as_str(), |(part, _)| part);
        let parameters = entry
            .shape
            .iter()
            .try_fold(1u64, |product, side| product.checked_mul(*side))
            .ok_or_else(|| failed(format!("{name}: shape {:?}", entry.shape)))?;
        let [start, end] = entry.data_offsets;
        let bytes = end
            .checked_sub(start)
            .ok_or_else(|| failed(format!("{name}: data_offsets [{start}, {end}]")))?;
        match parts.iter_mut().find(|known| known.part == part) {
            Some(known) => {
                known.parameters += parameters;
                known.bytes += bytes;
            }
            None => parts.push(PartCount {
                part: part.to_owned(),
                parameters,
                bytes,
            }),
        }
    }
    parts.sort_by_key(|part| std::cmp::Reverse(part.bytes));
    Ok(parts)
}
