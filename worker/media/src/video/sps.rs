//! The picture format in an H.264 sequence parameter set (ITU-T H.264, 7.3.2.1.1 and E.1.1).

use super::signal::Signal;

/// Size, sampling and colour of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sps {
    pub(super) width: u64,
    pub(super) height: u64,
    /// 1 is 4:2:0, the only supported format.
    pub(super) chroma_format: u64,
    /// Bit depth: the larger of luma and chroma.
    pub(super) bit_depth: u64,
    /// Whether fields are coded separately.
    pub(super) interlaced: bool,
    /// Range and colours; `None` if unspecified.
    pub(super) colour: Option<Signal>,
    /// Width and height of a pixel, in parts of each other; `None` if unspecified.
    pub(super) aspect: Option<[u32; 2]>,
}

/// Width and height of pixels by `aspect_ratio_idc` (table E-1), from 1.
const ASPECTS: [[u32; 2]; 16] = [
    [1, 1],
    [12, 11],
    [10, 11],
    [16, 11],
    [40, 33],
    [24, 11],
    [20, 11],
    [32, 11],
    [80, 33],
    [18, 11],
    [15, 11],
    [64, 33],
    [160, 99],
    [4, 3],
    [3, 2],
    [2, 1],
];

/// Profiles whose parameter sets carry chroma format and depths.
const HIGH: [u64; 13] = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135];

impl Sps {
    /// Reads the unit `nal`, with its type in the first byte. `None` if it is cut short or invalid.
    ///
    /// Most fields are read only to get past them: the format has no offsets. Every read checks the end
    /// of the bytes, and all sizes are computed with checks, since the bytes are untrusted.
    pub(super) fn read(nal: &[u8]) -> Option<Self> {
        let bytes = unescaped(nal.get(1..)?);
        let mut bits = Bits {
            bytes: &bytes,
            at: 0,
        };
        let profile = bits.take(8)?;
        bits.take(16)?;
        bits.unsigned()?;
        let (mut chroma_format, mut depth, mut separate) = (1, 8, false);
        if HIGH.contains(&profile) {
            chroma_format = bits.unsigned()?;
            separate = chroma_format == 3 && bits.flag()?;
            depth = 8 + bits.unsigned()?.max(bits.unsigned()?);
            bits.flag()?;
            if bits.flag()? {
                for list in 0..if chroma_format == 3 { 12 } else { 8 } {
                    if bits.flag()? {
                        bits.skip_scaling_list(if list < 6 { 16 } else { 64 })?;
                    }
                }
            }
        }
        bits.unsigned()?;
        match bits.unsigned()? {
            0 => {
                bits.unsigned()?;
            }
            1 => {
                bits.flag()?;
                bits.signed()?;
                bits.signed()?;
                // The standard allows 255; without a bound, a hostile count would keep the loop busy.
                for _ in 0..bits.unsigned()?.min(256) {
                    bits.signed()?;
                }
            }
            _ => {}
        }
        bits.unsigned()?;
        bits.flag()?;
        let columns = bits.unsigned()?.checked_add(1)?;
        let rows = bits.unsigned()?.checked_add(1)?;
        let interlaced = !bits.flag()?;
        if interlaced {
            bits.flag()?;
        }
        bits.flag()?;
        let mut crop = [0; 4];
        if bits.flag()? {
            for side in &mut crop {
                *side = bits.unsigned()?;
            }
        }
        let (aspect, colour) = if bits.flag()? {
            bits.usability()?
        } else {
            (None, None)
        };
        // Crops are in units of chroma samples, or of luma samples for monochrome and separate planes.
        let sampled = if separate { 0 } else { chroma_format };
        let unit_x = if matches!(sampled, 1 | 2) { 2 } else { 1 };
        let unit_y = if sampled == 1 { 2 } else { 1 } * if interlaced { 2 } else { 1 };
        let frame_rows = rows.checked_mul(if interlaced { 2 } else { 1 })?;
        let cut = |full: u64, a: u64, b: u64, unit: u64| {
            full.checked_sub(a.checked_add(b)?.checked_mul(unit)?)
                .filter(|&left| left > 0)
        };
        Some(Self {
            width: cut(columns.checked_mul(16)?, crop[0], crop[1], unit_x)?,
            height: cut(frame_rows.checked_mul(16)?, crop[2], crop[3], unit_y)?,
            chroma_format,
            bit_depth: depth,
            interlaced,
            colour,
            aspect,
        })
    }
}

/// Removes the emulation prevention: the byte 3 after two zeros, which keeps start codes out of the content.
fn unescaped(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut zeros = 0;
    for &byte in bytes {
        if zeros >= 2 && byte == 3 {
            zeros = 0;
            continue;
        }
        zeros = if byte == 0 { zeros + 1 } else { 0 };
        out.push(byte);
    }
    out
}

struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Bits<'_> {
    fn flag(&mut self) -> Option<bool> {
        Some(self.take(1)? == 1)
    }

    fn take(&mut self, count: usize) -> Option<u64> {
        let mut value = 0;
        for _ in 0..count {
            let byte = self.bytes.get(self.at / 8)?;
            value = value << 1 | u64::from(byte >> (7 - self.at % 8) & 1);
            self.at += 1;
        }
        Some(value)
    }

    /// An exponential Golomb code, `ue(v)` in the standard.
    fn unsigned(&mut self) -> Option<u64> {
        let mut zeros = 0;
        while !self.flag()? {
            zeros += 1;
            // Valid codes have at most 32 zeros; more would overflow the shift below.
            if zeros > 32 {
                return None;
            }
        }
        Some((1 << zeros) - 1 + self.take(zeros)?)
    }

    fn signed(&mut self) -> Option<i64> {
        let code = i64::try_from(self.unsigned()?).ok()?;
        Some(if code % 2 == 0 {
            -code / 2
        } else {
            code / 2 + 1
        })
    }

    fn skip_scaling_list(&mut self, length: usize) -> Option<()> {
        let (mut last, mut next) = (8i64, 8i64);
        for _ in 0..length {
            if next != 0 {
                next = (last + self.signed()?).rem_euclid(256);
            }
            last = if next == 0 { last } else { next };
        }
        Some(())
    }

    /// Shape of pixels, and range and colours: the start of the video usability information (E.1.1).
    fn usability(&mut self) -> Option<(Option<[u32; 2]>, Option<Signal>)> {
        let mut aspect = None;
        if self.flag()? {
            aspect = match self.take(8)? {
                255 => Some([self.take(16)? as u32, self.take(16)? as u32]),
                index => (index as usize)
                    .checked_sub(1)
                    .and_then(|index| ASPECTS.get(index).copied()),
            };
        }
        if self.flag()? {
            self.flag()?;
        }
        if !self.flag()? {
            return Some((aspect, None));
        }
        self.take(3)?;
        let mut colour = Signal {
            full_range: self.flag()?,
            ..Signal::UNSPECIFIED
        };
        if self.flag()? {
            colour.primaries = self.take(8)?;
            colour.transfer = self.take(8)?;
            colour.matrix = self.take(8)?;
        }
        Some((aspect, Some(colour)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_cut_parameter_set_is_taken_for_a_whole_one_and_none_panics() {
        // x264, High, 50x38 in 4x3 macroblocks; made by the clip script of the tests.
        let bytes: Vec<u8> = (0..4000u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
            .collect();
        for start in 0..bytes.len() {
            // Any bytes must give an answer.
            let _ = Sps::read(&bytes[start..]);
        }
        assert_eq!(Sps::read(&[]), None);
        assert_eq!(Sps::read(&[0x67]), None);
        assert_eq!(Sps::read(&[0; 64]), None, "zeros are an endless code");
    }
}
