//! Masks as run lengths, in COCO's form: `{"size": [height, width], "counts": …}`.
//!
//! Pixels are counted down the columns, and the first run is background. Counts are a list of numbers, or pycocotools'
//! text: digits of five bits from `'0'` on, with a sixth bit if more digits follow. From the fourth run on, each count is
//! the difference from the run two before.

use crate::Value;
use thiserror::Error;

/// Longest side, pixels.
const MAX_SIDE: usize = 16384;
/// Most digits of a count: enough for 2 × `MAX_SIDE`² and a sign.
const MAX_DIGITS: u32 = 6;

/// Why run lengths can't be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum RleError {
    /// A field is absent or of another type.
    #[error("run lengths need {field}, but there is {found}")]
    Field {
        /// The field.
        field: &'static str,
        /// Type of its value.
        found: String,
    },
    /// Sides of zero, of over 16384, or that are not whole numbers.
    #[error("run lengths of an image with sides {0:?}; each must be 1 to 16384")]
    Size(Vec<String>),
    /// A count that is not a whole number, or ends inside its digits.
    #[error("run {run} is not a number of pixels")]
    Count {
        /// Its index.
        run: usize,
    },
    /// More runs than pixels, or runs that don't add up to all pixels.
    #[error("{runs} runs of {pixels} pixels in an image of {height} × {width}")]
    Total {
        /// Number of runs.
        runs: usize,
        /// Sum of the runs that were read.
        pixels: u64,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
}

/// A mask that is decoded only on demand: a clip has thousands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunLengths {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Lengths of runs, alternately of background and mask; they add up to all pixels.
    runs: Vec<u32>,
}

impl RunLengths {
    /// The mask in a dictionary of `size` and `counts`.
    ///
    /// # Errors
    /// If these fields are missing or contradict each other.
    pub fn read(value: &Value) -> Result<Self, RleError> {
        let (height, width) = size(value)?;
        let mut mask = Self {
            height,
            width,
            runs: Vec::new(),
        };
        match value.get("counts") {
            Some(Value::Bytes(digits)) => mask.digits(digits)?,
            Some(Value::Text(digits)) => mask.digits(digits.as_bytes())?,
            Some(counts) => match counts.numbers() {
                Some(counts) => mask.numbers(&counts.values)?,
                None => return Err(missing("counts", Some(counts))),
            },
            None => return Err(missing("counts", None)),
        }
        mask.check(true)?;
        Ok(mask)
    }

    /// The mask of all `pixels` above 0, `[height, width]` by rows.
    ///
    /// # Errors
    /// If a side is 0 or over 16384, or the number of pixels is wrong.
    pub fn of_pixels(height: usize, width: usize, pixels: &[f64]) -> Result<Self, RleError> {
        let sides = 1..=MAX_SIDE;
        if !sides.contains(&height) || !sides.contains(&width) {
            return Err(RleError::Size(vec![height.to_string(), width.to_string()]));
        }
        let mut mask = Self {
            height,
            width,
            runs: Vec::new(),
        };
        let (mut run, mut is_inside) = (0, false);
        for column in 0..width {
            let below = pixels.iter().skip(column).step_by(width);
            for pixel in below {
                if (*pixel > 0.0) != is_inside {
                    mask.runs.push(std::mem::take(&mut run));
                    is_inside = !is_inside;
                }
                run += 1;
            }
        }
        mask.runs.push(run);
        mask.check(true)?;
        Ok(mask)
    }

    /// Number of pixels in the mask.
    pub fn area(&self) -> usize {
        let inside = self.runs.iter().skip(1).step_by(2);
        inside.map(|run| *run as usize).sum()
    }

    /// The pixels, `[height, width]` by rows: 255 in the mask and 0 elsewhere.
    pub fn decode(&self) -> Vec<u8> {
        let mut pixels = vec![0; self.height * self.width];
        let mut at = 0;
        for (run_index, run) in self.runs.iter().enumerate() {
            let end = at + *run as usize;
            // Odd runs are the mask.
            if run_index % 2 == 1 {
                for at in at..end {
                    let (column, row) = (at / self.height, at % self.height);
                    if let Some(pixel) = pixels.get_mut(row * self.width + column) {
                        *pixel = 255;
                    }
                }
            }
            at = end;
        }
        pixels
    }

    fn numbers(&mut self, counts: &[f64]) -> Result<(), RleError> {
        for (run, count) in counts.iter().enumerate() {
            let whole = (0.0..=f64::from(u32::MAX)).contains(count) && count.fract() == 0.0;
            if !whole {
                return Err(RleError::Count { run });
            }
            self.push(*count as u32)?;
        }
        Ok(())
    }

    fn digits(&mut self, digits: &[u8]) -> Result<(), RleError> {
        let mut digits = digits.iter();
        loop {
            let run = self.runs.len();
            let bad = RleError::Count { run };
            let (mut count, mut shift) = (0i64, 0);
            loop {
                let Some(digit) = digits.next() else {
                    if shift == 0 {
                        return Ok(());
                    }
                    return Err(bad);
                };
                let digit = digit.checked_sub(b'0').filter(|digit| *digit < 64);
                let digit = i64::from(digit.ok_or(bad.clone())?);
                if shift == 5 * MAX_DIGITS {
                    return Err(bad);
                }
                count |= (digit & 0x1f) << shift;
                shift += 5;
                if digit & 0x20 == 0 {
                    if digit & 0x10 != 0 {
                        count |= -1 << shift;
                    }
                    break;
                }
            }
            if run > 2 {
                count += self.runs.get(run - 2).map_or(0, |run| i64::from(*run));
            }
            self.push(u32::try_from(count).map_err(|_| bad)?)?;
        }
    }

    fn push(&mut self, run: u32) -> Result<(), RleError> {
        self.runs.push(run);
        // One more run than pixels is possible, as the first may be empty.
        if self.runs.len() > self.height * self.width + 1 {
            return self.check(false);
        }
        Ok(())
    }

    /// An error unless the runs add up to all pixels and `fits` is true.
    fn check(&self, fits: bool) -> Result<(), RleError> {
        let pixels = self.runs.iter().map(|run| u64::from(*run)).sum();
        if fits && pixels == (self.height * self.width) as u64 {
            return Ok(());
        }
        Err(RleError::Total {
            runs: self.runs.len(),
            pixels,
            height: self.height,
            width: self.width,
        })
    }
}

fn missing(field: &'static str, found: Option<&Value>) -> RleError {
    RleError::Field {
        field,
        found: found.map_or("none".into(), Value::kind),
    }
}

/// Height and width.
fn size(value: &Value) -> Result<(usize, usize), RleError> {
    let found = value.get("size");
    let sides = found.and_then(Value::numbers);
    let sides = sides.as_ref().and_then(|sides| sides.fixed::<2>());
    let sides = sides.ok_or(missing("size of two numbers", found))?;
    let whole = |side: f64| {
        ((1.0..=MAX_SIDE as f64).contains(&side) && side.fract() == 0.0).then_some(side as usize)
    };
    match sides.map(whole) {
        [Some(height), Some(width)] => Ok((height, width)),
        _ => Err(RleError::Size(
            sides.iter().map(|side| format!("{side:.6}")).collect(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(size: [f64; 2], counts: Value) -> Result<RunLengths, RleError> {
        RunLengths::read(&Value::Dict(vec![
            (
                Value::Text("size".into()),
                Value::List(size.map(Value::Number).to_vec()),
            ),
            (Value::Text("counts".into()), counts),
        ]))
    }

    /// pycocotools' encoding of a block of 3 × 3 pixels and one more, in 5 rows of 7.
    const COUNTS: &[u8] = b";320001N4";

    #[test]
    fn pixels_come_back() {
        let pixels = [0.0, 1.0, 1.0, 0.0, 255.0, 0.0];
        let mask = RunLengths::of_pixels(2, 3, &pixels).expect("a mask");
        assert_eq!(mask.decode(), [0, 255, 255, 0, 255, 0]);
        assert_eq!((mask.area(), mask.height, mask.width), (3, 2, 3));
        let all = RunLengths::of_pixels(1, 2, &[1.0, 1.0]).expect("a mask");
        assert_eq!(all.decode(), [255, 255]);
        assert!(RunLengths::of_pixels(2, 3, &pixels[..5]).is_err());
        assert!(RunLengths::of_pixels(0, 3, &[]).is_err());
    }

    #[test]
    fn masks_of_pycocotools_are_decoded_in_every_form() {
        let mut expected = vec![0; 35];
        for (row, column) in [
            (1, 2),
            (1, 3),
            (1, 4),
            (2, 2),
            (2, 3),
            (2, 4),
            (3, 2),
            (3, 3),
        ] {
            expected[row * 7 + column] = 255;
        }
        (expected[3 * 7 + 4], expected[2 * 7 + 5]) = (255, 255);
        let runs = [11.0, 3.0, 2.0, 3.0, 2.0, 3.0, 3.0, 1.0, 7.0];
        for counts in [
            Value::Bytes(COUNTS.to_vec()),
            Value::Text(str::from_utf8(COUNTS).expect("text").into()),
            Value::List(runs.map(Value::Number).to_vec()),
        ] {
            let mask = of([5.0, 7.0], counts).expect("reads");
            assert_eq!((mask.height, mask.width, mask.area()), (5, 7, 10));
            assert_eq!(mask.decode(), expected);
        }
        let all = Value::List([0.0, 6.0].map(Value::Number).to_vec());
        assert_eq!(of([2.0, 3.0], all).expect("reads").decode(), [255; 6]);
    }

    #[test]
    fn runs_of_many_digits_are_whole() {
        // 2^28, the largest count of all: its bit lies in the sixth digit, below that of the sign.
        let mask = of([16384.0, 16384.0], Value::Bytes(b"PPPPP8".to_vec()));
        let mask = mask.expect("reads");
        assert_eq!((mask.area(), mask.runs.clone()), (0, vec![1 << 28]));
    }

    #[test]
    fn lies_are_errors() {
        let bytes = |counts: &[u8]| Value::Bytes(counts.to_vec());
        let numbers = |counts: &[f64]| {
            Value::List(counts.iter().map(|count| Value::Number(*count)).collect())
        };
        // One row less or more than there are runs for.
        for height in [4.0, 6.0] {
            let found = of([height, 7.0], bytes(COUNTS));
            assert!(matches!(found, Err(RleError::Total { .. })), "{found:?}");
        }
        let sides = [
            [0.0, 5.0],
            [5.0, -1.0],
            [1.5, 2.0],
            [16385.0, 1.0],
            [f64::NAN, 1.0],
        ];
        for size in sides {
            let found = of(size, bytes(COUNTS));
            assert!(matches!(found, Err(RleError::Size(_))), "{found:?}");
        }
        // Ends inside a count; a character below and one above the digits; too many digits;
        // a negative count.
        for counts in [b";P".as_slice(), b"; ", b"~", b"PPPPPPP0", b"O"] {
            let found = of([5.0, 7.0], bytes(counts));
            assert!(matches!(found, Err(RleError::Count { .. })), "{found:?}");
        }
        for counts in [[35.5], [-1.0], [f64::NAN], [1e300]] {
            let found = of([5.0, 7.0], numbers(&counts));
            assert_eq!(found, Err(RleError::Count { run: 0 }));
        }
        // Empty runs without end stop at the number of pixels.
        let found = of([5.0, 7.0], bytes(&[b'0'; 1 << 20]));
        assert!(matches!(found, Err(RleError::Total { runs: 37, .. })));
        let found = RunLengths::read(&Value::Nothing).expect_err("no fields");
        assert!(found.to_string().contains("size"), "{found}");
        let found = of([5.0, 7.0], Value::Nothing).expect_err("no counts");
        assert!(found.to_string().contains("counts"), "{found}");
    }
}
