//! HDF5 files of PeopleSnapshot: arrays by name at the top level.

use super::Source;
use crate::ImportError;
use hdf5_pure::{Dataset, File};
use std::fmt;
use std::sync::Arc;
use yoto_proto::pose_track::MAX_SIDE;

/// Most numbers per read; masks are read one frame at a time.
const MAX_NUMBERS: u64 = 1 << 24;
/// Most bytes of a chunk, which is read and unpacked as a whole. Writers choose about a megabyte.
const MAX_CHUNK: u64 = 1 << 28;

/// An open file.
pub(crate) struct Hdf5<'a> {
    source: &'a Source,
    name: &'static str,
    file: File,
}

impl<'a> Hdf5<'a> {
    pub(crate) fn open(source: &'a Source, name: &'static str) -> Result<Self, ImportError> {
        if !source.has(name) {
            return Err(source.fault("MISSING", name, None, "", "there is no such file"));
        }
        let file = File::open_streaming(source.path(name))
            .map_err(|error| source.fault("UNREADABLE", name, None, "", error.to_string()))?;
        Ok(Self { source, name, file })
    }

    fn fault(&self, code: &str, field: &str, message: impl Into<String>) -> ImportError {
        self.source.fault(code, self.name, None, field, message)
    }

    fn dataset(&self, field: &str) -> Result<(Dataset, Vec<u64>), ImportError> {
        let unreadable = |error: hdf5_pure::Error| {
            self.fault("UNREADABLE", field, format!("no readable dataset: {error}"))
        };
        let dataset = self.file.dataset(field).map_err(unreadable)?;
        let shape = dataset.shape().map_err(unreadable)?;
        self.check_chunks(field, &dataset, &shape)?;
        Ok((dataset, shape))
    }

    /// Refuses chunks that are larger than the file or than [`MAX_CHUNK`], since their reader takes the memory that they
    /// declare, and chunks outside of the dataset, whose positions it adds up.
    fn check_chunks(
        &self,
        field: &str,
        dataset: &Dataset,
        shape: &[u64],
    ) -> Result<(), ImportError> {
        let size = dataset.element_size().unwrap_or(1);
        let sides = dataset.chunk_shape().ok().flatten().unwrap_or_default();
        let unpacked = sides
            .iter()
            .try_fold(size, |all, side| all.checked_mul(*side));
        if unpacked.is_none_or(|bytes| bytes > MAX_CHUNK) {
            let message = format!("chunks of shape {sides:?}: {MAX_CHUNK} bytes are allowed");
            return Err(self.fault("TOO_LARGE", field, message));
        }
        let path = self.source.path(self.name);
        let length = std::fs::metadata(path).map_or(0, |file| file.len());
        // Chunks that can't be listed are the reader's to refuse.
        for chunk in dataset.chunks().unwrap_or_default() {
            let end = chunk.address.checked_add(chunk.storage_size);
            if end.is_none_or(|end| end > length) {
                let bytes = chunk.storage_size;
                let message = format!("a chunk of {bytes} bytes ends after the file");
                return Err(self.fault("UNREADABLE", field, message));
            }
            if chunk.offset.iter().zip(shape).any(|(at, side)| at >= side) {
                let message = format!("a chunk is at {:?} of {shape:?}", chunk.offset);
                return Err(self.fault("UNREADABLE", field, message));
            }
        }
        Ok(())
    }

    /// Extents and numbers of a dataset, finite or not.
    pub(crate) fn unchecked(&self, field: &str) -> Result<(Vec<u64>, Vec<f64>), ImportError> {
        let (dataset, shape) = self.dataset(field)?;
        let count = shape
            .iter()
            .try_fold(1u64, |all, side| all.checked_mul(*side));
        if count.is_none_or(|count| count > MAX_NUMBERS) {
            return Err(self.fault("TOO_LARGE", field, format!("shape {shape:?}")));
        }
        let values = dataset.read_f64();
        let values = values.map_err(|error| self.fault("UNREADABLE", field, error.to_string()))?;
        Ok((shape, values))
    }

    /// The numbers of [`Self::unchecked`], which must be finite.
    pub(crate) fn numbers(&self, field: &str) -> Result<(Vec<u64>, Vec<f64>), ImportError> {
        let (shape, values) = self.unchecked(field)?;
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok((shape, values)),
            Some(at) => {
                let message = "not a finite number";
                Err(self.fault("NOT_FINITE", &format!("{field}[{at}]"), message))
            }
        }
    }

    /// A dataset of shape `[any, N]`, with numbers finite or not.
    pub(crate) fn unchecked_rows<const N: usize>(
        &self,
        field: &str,
    ) -> Result<Vec<[f64; N]>, ImportError> {
        let (shape, values) = self.unchecked(field)?;
        match shape[..] {
            [_, columns] if columns == N as u64 => Ok(values.as_chunks::<N>().0.to_vec()),
            _ => {
                let message = format!("the shape is {shape:?}, [frames, {N}] is needed");
                Err(self.fault("SIZE_MISMATCH", field, message))
            }
        }
    }

    /// A dataset of shape `[frames, height, width]`, whose frames are read on demand.
    pub(crate) fn stack(&self, field: &str) -> Result<MaskStack, ImportError> {
        let (dataset, shape) = self.dataset(field)?;
        let side = 1..=u64::from(MAX_SIDE);
        let (&[frames, height, width], false) = (
            <&[u64; 3]>::try_from(shape.as_slice()).unwrap_or(&[0; 3]),
            dataset.element_size().is_ok_and(|size| size > 8),
        ) else {
            return Err(self.fault("SIZE_MISMATCH", field, "elements are not masks"));
        };
        if frames == 0 || !side.contains(&height) || !side.contains(&width) {
            let message = format!("the shape is {shape:?}, [frames, height, width] is needed");
            return Err(self.fault("SIZE_MISMATCH", field, message));
        }
        Ok(MaskStack {
            file: self.name,
            frames,
            size: [width as u32, height as u32],
            dataset: Arc::new(dataset),
        })
    }
}

/// Masks of many frames in one dataset, non-zero where the person is.
#[derive(Clone)]
pub struct MaskStack {
    file: &'static str,
    frames: u64,
    size: [u32; 2],
    dataset: Arc<Dataset>,
}

impl fmt::Debug for MaskStack {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            to,
            "{} masks of {:?} in {}",
            self.frames, self.size, self.file
        )
    }
}

impl MaskStack {
    /// Number of masks.
    pub fn frames(&self) -> usize {
        self.frames as usize
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The file's name.
    pub fn file(&self) -> &'static str {
        self.file
    }

    /// Mask `at`, `[height, width]`, 255 where the person is.
    ///
    /// # Errors
    /// The error of the file's reader.
    pub fn read(&self, at: usize) -> Result<Vec<u8>, String> {
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let bytes = self.dataset.read_raw_rows(at as u64, 1);
        let bytes = bytes.map_err(|error| error.to_string())?;
        let size = bytes.len() / pixels;
        if size == 0 || bytes.len() != pixels * size {
            return Err(format!("{} bytes for {pixels} pixels", bytes.len()));
        }
        // Zero is zero in every type of number.
        let covered = |element: &[u8]| element.iter().any(|byte| *byte != 0);
        let mask = bytes.chunks_exact(size).map(|e| 255 * u8::from(covered(e)));
        Ok(mask.collect())
    }
}
