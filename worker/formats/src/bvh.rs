//! BVH: a skeleton as offsets and channels, and a motion as a table of channel values.
//!
//! The format has no standard except its examples. This reader accepts the common subset of writers: one `ROOT`,
//! `JOINT`s and `End Site`s in braces, `OFFSET` and `CHANNELS`, then `MOTION` with `Frames:`, `Frame Time:` and the
//! frames, each of which begins a line. All frames that are there are read, however many the header counts, and a last
//! one that is cut off is left out, with a note. Angles are degrees. Rotations are applied in the order of the channels, with the first channel
//! outermost. Lengths are in the unit of the writer: centimetres, inches or another.

use thiserror::Error;

/// Most joints, not counting end sites.
const MAX_JOINTS: usize = 1024;
/// Most numbers of a motion.
const MAX_NUMBERS: usize = 1 << 26;

/// Why a BVH file can't be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("line {line}: {message}")]
pub struct BvhError {
    /// Counted from 1.
    pub line: usize,
    /// The fault.
    pub message: String,
}

/// Target of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Position along an axis (0 x, 1 y, 2 z), in the file's unit.
    Position(usize),
    /// Rotation about an axis, degrees in the file, radians here.
    Rotation(usize),
}

/// A joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in the file.
    pub name: String,
    /// Index of the parent, which comes before; `None` for the root.
    pub parent: Option<usize>,
    /// Offset from the parent at rest, in the file's unit.
    pub offset: [f64; 3],
    /// Channels in the order of the file.
    pub channels: Vec<Channel>,
    /// Offset of an end site from this joint.
    pub end: Option<[f64; 3]>,
}

/// A BVH file.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    /// The joints; parents come before their children.
    pub joints: Vec<Joint>,
    /// Seconds per frame.
    pub frame_time: f64,
    /// One row per frame: the values of every joint's channels, in order. Angles in radians. Some writers have numbers
    /// that are not finite.
    pub frames: Vec<Vec<f64>>,
    /// Notes about differences from the header.
    pub notes: Vec<String>,
}

/// The skeleton and the motion in `text`.
///
/// # Errors
/// If a line does not follow the format, or has an invalid number; the error names the first such line.
pub fn read(text: &str) -> Result<Bvh, BvhError> {
    // Some editors begin a file with a byte-order mark.
    let mut reader = Reader::new(text.trim_start_matches('\u{feff}'));
    reader.word("HIERARCHY")?;
    let joints = reader.hierarchy()?;
    reader.word("MOTION")?;
    let (frame_time, frames, notes) = reader.motion(&joints)?;
    Ok(Bvh {
        joints,
        frame_time,
        frames,
        notes,
    })
}

/// The words of a text with their lines.
struct Reader<'a> {
    words: std::iter::Peekable<Box<dyn Iterator<Item = (usize, &'a str)> + 'a>>,
    line: usize,
}

impl<'a> Reader<'a> {
    fn new(text: &'a str) -> Self {
        let words = text
            .lines()
            .enumerate()
            .flat_map(|(at, line)| line.split_whitespace().map(move |word| (at + 1, word)));
        let words: Box<dyn Iterator<Item = _> + 'a> = Box::new(words);
        Self {
            words: words.peekable(),
            line: 1,
        }
    }

    fn fault(&self, message: impl Into<String>) -> BvhError {
        BvhError {
            line: self.line,
            message: message.into(),
        }
    }

    fn next(&mut self, what: &str) -> Result<&'a str, BvhError> {
        match self.words.next() {
            Some((line, word)) => {
                self.line = line;
                Ok(word)
            }
            None => Err(self.fault(format!("the file ends instead of {what}"))),
        }
    }

    fn word(&mut self, expected: &str) -> Result<(), BvhError> {
        let found = self.next(expected)?;
        if found.eq_ignore_ascii_case(expected) {
            return Ok(());
        }
        let found: String = found.chars().take(40).collect();
        Err(self.fault(format!("'{found}' instead of {expected}")))
    }

    fn number(&mut self, what: &str) -> Result<f64, BvhError> {
        let word = self.next(what)?;
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => {
                let word: String = word.chars().take(40).collect();
                Err(self.fault(format!("{what}: '{word}' is not a number")))
            }
        }
    }

    fn whole(&mut self, what: &str, limit: usize) -> Result<usize, BvhError> {
        let number = self.number(what)?;
        if number >= 0.0 && number <= limit as f64 && number.fract() == 0.0 {
            Ok(number as usize)
        } else {
            Err(self.fault(format!("{what}: {number} is not between 0 and {limit}")))
        }
    }

    fn offset(&mut self) -> Result<[f64; 3], BvhError> {
        let mut offset = [0.0; 3];
        for value in &mut offset {
            *value = self.number("OFFSET")?;
        }
        Ok(offset)
    }

    /// A name up to the brace, since some writers use blanks in names.
    fn name(&mut self) -> Result<String, BvhError> {
        let mut name = String::new();
        loop {
            match self.next("a joint's name")? {
                "{" if name.is_empty() => return Err(self.fault("a joint without a name")),
                "{" => return Ok(name),
                word => {
                    if !name.is_empty() {
                        name.push(' ');
                    }
                    name.push_str(word);
                }
            }
            if name.len() > 256 {
                return Err(self.fault("a joint's name of over 256 bytes"));
            }
        }
    }

    fn hierarchy(&mut self) -> Result<Vec<Joint>, BvhError> {
        self.word("ROOT")?;
        let root = self.name()?;
        let mut joints = vec![joint(root, None)];
        // Joints with an open brace, the innermost last; end sites have their own braces. A list instead of
        // recursion, so that deep nesting can't exhaust the stack.
        let mut open = vec![0];
        while let Some(&at) = open.last() {
            let word = self.next("'}'")?;
            match word.to_ascii_uppercase().as_str() {
                "OFFSET" => {
                    let offset = self.offset()?;
                    self.joint_mut(&mut joints, at)?.offset = offset;
                }
                "CHANNELS" => {
                    let channels = self.channels()?;
                    self.joint_mut(&mut joints, at)?.channels = channels;
                }
                "JOINT" => {
                    let name = self.name()?;
                    if joints.len() >= MAX_JOINTS {
                        return Err(self.fault(format!("more than {MAX_JOINTS} joints")));
                    }
                    joints.push(joint(name, Some(at)));
                    open.push(joints.len() - 1);
                }
                "END" => {
                    self.word("Site")?;
                    self.word("{")?;
                    self.word("OFFSET")?;
                    let end = self.offset()?;
                    self.joint_mut(&mut joints, at)?.end = Some(end);
                    self.word("}")?;
                }
                "}" => drop(open.pop()),
                other => {
                    let other: String = other.chars().take(40).collect();
                    return Err(self.fault(format!(
                        "'{other}' instead of OFFSET, CHANNELS, JOINT, End Site or '}}'"
                    )));
                }
            }
        }
        Ok(joints)
    }

    fn joint_mut<'j>(&self, joints: &'j mut [Joint], at: usize) -> Result<&'j mut Joint, BvhError> {
        let fault = self.fault("unmatched closing brace");
        joints.get_mut(at).ok_or(fault)
    }

    fn channels(&mut self) -> Result<Vec<Channel>, BvhError> {
        let count = self.whole("CHANNELS", 6)?;
        let mut channels = Vec::with_capacity(count);
        for _ in 0..count {
            let word = self.next("a channel")?.to_ascii_lowercase();
            let axis = match word.as_bytes().first() {
                Some(b'x') => 0,
                Some(b'y') => 1,
                Some(b'z') => 2,
                _ => 3,
            };
            let channel = match word.get(1..) {
                Some("position") if axis < 3 => Channel::Position(axis),
                Some("rotation") if axis < 3 => Channel::Rotation(axis),
                _ => {
                    let word: String = word.chars().take(40).collect();
                    return Err(self.fault(format!("'{word}' is not a channel such as Xposition")));
                }
            };
            if channels.contains(&channel) {
                return Err(self.fault(format!("the channel {word} is repeated")));
            }
            channels.push(channel);
        }
        Ok(channels)
    }

    fn motion(&mut self, joints: &[Joint]) -> Result<Motion, BvhError> {
        self.word("Frames:")?;
        let channels: Vec<Channel> = joints
            .iter()
            .flat_map(|joint| joint.channels.iter().copied())
            .collect();
        if channels.is_empty() {
            return Err(self.fault("no joint has a channel: nothing moves"));
        }
        let count = self.whole("Frames:", MAX_NUMBERS / channels.len())?;
        self.word("Frame")?;
        self.word("Time:")?;
        let time = self.number("Frame Time:")?;
        if !(1e-5..=100.0).contains(&time) {
            return Err(self.fault(format!("Frame Time: {time} seconds per frame")));
        }
        let table = self.table(&channels, count)?;
        let value = |(channel, value): (&Channel, &f64)| match channel {
            Channel::Position(_) => *value,
            Channel::Rotation(_) => value.to_radians(),
        };
        let rows = table.numbers.chunks_exact(channels.len());
        let frames: Vec<Vec<f64>> = rows
            .map(|row| channels.iter().zip(row).map(value).collect())
            .collect();
        let mut notes = Vec::new();
        if table.is_cut {
            notes.push(format!(
                "the file ends within frame {}, which is left out",
                frames.len()
            ));
        }
        if frames.len() != count {
            notes.push(format!(
                "the header counts {count} frames, the file has {}, which are read",
                frames.len()
            ));
        }
        if frames.is_empty() {
            return Err(self.fault(format!("the file ends instead of frame {}", frames.len())));
        }
        Ok((time, frames, notes))
    }

    /// The numbers of all frames of `channels`. The header counts `count` frames.
    fn table(&mut self, channels: &[Channel], count: usize) -> Result<Table, BvhError> {
        let width = channels.len();
        let mut numbers: Vec<f64> = Vec::new();
        // Where each line begins.
        let mut lines: Vec<(usize, usize)> = Vec::new();
        while let Some((line, word)) = self.words.next() {
            self.line = line;
            let Ok(number) = word.parse::<f64>() else {
                // The last word may be cut off.
                if self.words.peek().is_none() && word == "-" {
                    break;
                }
                let word: String = word.chars().take(40).collect();
                return Err(self.fault(format!(
                    "frame {}: '{word}' is not a number",
                    numbers.len() / width
                )));
            };
            if numbers.len() >= MAX_NUMBERS {
                return Err(self.fault(format!("more than {MAX_NUMBERS} numbers")));
            }
            if lines.last().is_none_or(|(last, _)| *last != line) {
                lines.push((line, numbers.len()));
            }
            numbers.push(number);
        }
        let whole = numbers.len() - numbers.len() % width;
        if numbers.len() != count * width {
            // Only where each frame begins a line are these surely the frames.
            let begins = |at: usize| lines.binary_search_by_key(&at, |(_, start)| *start).is_ok();
            if !(0..numbers.len()).step_by(width).all(begins) {
                let ends = lines.iter().skip(1).map(|(_, start)| *start);
                let mut lengths = lines.iter().zip(ends.chain([numbers.len()]));
                let odd = lengths.find(|((_, start), end)| end - start != width);
                let (line, start) = odd.map_or((self.line, 0), |(line, _)| *line);
                self.line = line;
                return Err(self.fault(format!(
                    "frame {} does not end with this line: {width} channels have {width} numbers per frame",
                    start / width
                )));
            }
        }
        let is_cut = whole < numbers.len();
        numbers.truncate(whole);
        Ok(Table { numbers, is_cut })
    }
}

/// Seconds per frame, frames, and notes.
type Motion = (f64, Vec<Vec<f64>>, Vec<String>);

/// The numbers of a motion.
struct Table {
    /// The channel values of all whole frames, frame by frame.
    numbers: Vec<f64>,
    /// Whether the file has a part of one more frame.
    is_cut: bool,
}

fn joint(name: String, parent: Option<usize>) -> Joint {
    Joint {
        name,
        parent,
        offset: [0.0; 3],
        channels: Vec::new(),
        end: None,
    }
}

#[cfg(test)]
mod tests;
