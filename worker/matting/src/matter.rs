//! A matting model that is applied to pictures.

use crate::form::{Axes, Signature, name};
use crate::output::{Coverage, coverage};
use crate::person::{one, stretched};
use crate::{Levels, MattingError, ModelForm, load};
use image::{RgbImage, imageops};
use rten::{Model, NodeId, Value, ValueOrView};
use std::path::{Path, PathBuf};

/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 4 << 30;

/// A matting model, and its memory of a clip's pictures.
#[derive(Debug)]
pub struct Matter {
    path: PathBuf,
    model: Model,
    signature: Signature,
    levels: Levels,
    /// Whether its outputs have turned out to be logits.
    logits: bool,
    /// RVM's memory; `None` before the first picture.
    memory: Option<[Value; 4]>,
}

/// The person in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Matte {
    /// Coverage of each pixel, `[height, width]`, from 0 to 255.
    pub coverage: Vec<u8>,
    /// Whether a person was found.
    pub is_somebody: bool,
}

impl Matter {
    /// Opens the ONNX file `path`, which takes pictures with the `levels`.
    ///
    /// # Errors
    /// If the file can't be read, is not ONNX, has unknown operators, or has inputs and outputs that don't
    /// belong to a matting model.
    pub fn open(path: &Path, levels: Levels) -> Result<Self, MattingError> {
        let read = |error| MattingError::Read {
            path: path.to_owned(),
            error,
        };
        let refused = |message: String| MattingError::Load {
            path: path.to_owned(),
            message,
        };
        let meta = std::fs::metadata(path).map_err(read)?;
        if !meta.is_file() || meta.len() > MAX_BYTES {
            return Err(refused(
                "is not a file of at most 4 GiB: an ONNX file is needed".into(),
            ));
        }
        let model = load::network(path).map_err(refused)?;
        let signature = Signature::of(&model).map_err(|message| MattingError::Form {
            path: path.to_owned(),
            message,
        })?;
        Ok(Self {
            path: path.to_owned(),
            model,
            signature,
            levels,
            logits: false,
            memory: None,
        })
    }

    /// The model's form.
    pub fn form(&self) -> ModelForm {
        self.signature.form()
    }

    /// The normalisation of its input.
    pub fn levels(&self) -> Levels {
        self.levels
    }

    /// Changes the normalisation of its input, and clears its memory.
    pub fn set_levels(&mut self, levels: Levels) {
        self.levels = levels;
        self.logits = false;
        self.memory = None;
    }

    /// The person in a picture `rgb`, `[height, width, 3]`, of `size` (width, height).
    ///
    /// If there are several people, the matte shows the one in `expected` (a mask of the picture's size), or the largest.
    ///
    /// # Errors
    /// [`MattingError::Picture`] if `rgb` or `expected` does not have that size; [`MattingError::Run`] if the
    /// network fails, or its output is not a matte.
    pub fn look(
        &mut self,
        rgb: &[u8],
        size: [usize; 2],
        expected: Option<&[u8]>,
    ) -> Result<Matte, MattingError> {
        let [width, height] = size;
        let wrong = |bytes: usize| MattingError::Picture {
            width,
            height,
            bytes,
        };
        if let Some(mask) = expected
            && width.checked_mul(height) != Some(mask.len())
        {
            return Err(wrong(mask.len()));
        }
        let sides = u32::try_from(width).ok().zip(u32::try_from(height).ok());
        let picture = sides
            .filter(|(width, height)| *width > 0 && *height > 0)
            .and_then(|(width, height)| RgbImage::from_raw(width, height, rgb.to_vec()))
            .ok_or_else(|| wrong(rgb.len()))?;
        let mut coverage = self.run(&picture).map_err(|message| MattingError::Run {
            path: self.path.clone(),
            message,
        })?;
        one(&mut coverage, expected.map(|mask| (mask, size)));
        let is_somebody = coverage.levels.iter().any(|level| *level > 0.0);
        let coverage = stretched(coverage, size).ok_or_else(|| wrong(rgb.len()))?;
        Ok(Matte {
            coverage,
            is_somebody,
        })
    }

    fn run(&mut self, picture: &RgbImage) -> Result<Coverage, String> {
        let seen = self
            .signature
            .seen(picture.width() as usize, picture.height() as usize);
        let mut inputs: Vec<(NodeId, ValueOrView)> =
            vec![(self.signature.picture, self.input(picture, seen)?.into())];
        let mut outputs = vec![self.signature.matte];
        if let Some(recurrence) = &self.signature.recurrence {
            let of = |shape: &[usize], value: f32| {
                Value::from_shape(shape, vec![value]).map_err(|error| error.to_string())
            };
            let memory = match self.memory.take() {
                Some(memory) => memory,
                None => {
                    let nothing = of(&[1, 1, 1, 1], 0.0)?;
                    [(); 4].map(|()| nothing.clone())
                }
            };
            inputs.push((recurrence.ratio, of(&[1], Signature::ratio(seen))?.into()));
            let before = recurrence.before.iter().copied();
            inputs.extend(before.zip(memory.map(ValueOrView::from)));
            outputs.extend(recurrence.after);
        }
        let results = self.model.run(inputs, &outputs, None);
        let results = results.map_err(|error| format!("the network failed: {error}"))?;
        let mut results = results.into_iter();
        let matte = results.next().ok_or("gives no matte")?;
        self.memory = results.collect::<Vec<Value>>().try_into().ok();
        coverage(&matte, &mut self.logits).map_err(|message| {
            format!(
                "the output {} {message}",
                name(&self.model, self.signature.matte)
            )
        })
    }

    /// The network's input for a picture, with `seen` rows and columns.
    fn input(&self, picture: &RgbImage, [rows, columns]: [usize; 2]) -> Result<Value, String> {
        let filter = imageops::FilterType::Triangle;
        let scaled = imageops::resize(picture, columns as u32, rows as u32, filter);
        let (pixels, _) = scaled.as_raw().as_chunks::<3>();
        let (shape, values): (_, Vec<f32>) = match self.signature.axes {
            Axes::ChannelsFirst => {
                let channel = |channel: usize| {
                    pixels
                        .iter()
                        .map(move |it| self.levels.of(it[channel], channel))
                };
                ([1, 3, rows, columns], (0..3).flat_map(channel).collect())
            }
            Axes::ChannelsLast => {
                let levels = |pixel: &[u8; 3]| -> [f32; 3] {
                    std::array::from_fn(|channel| self.levels.of(pixel[channel], channel))
                };
                (
                    [1, rows, columns, 3],
                    pixels.iter().flat_map(levels).collect(),
                )
            }
        };
        Value::from_shape(shape, values).map_err(|error| error.to_string())
    }
}
