//! BVH: a skeleton as offsets and channels, and a motion as a table of channel values.
//!
//! The format has no standard except its examples. This reader accepts the common subset of writers: one `ROOT`,
//! `JOINT`s and `End Site`s in braces, `OFFSET` and `CHANNELS`, then `MOTION` with `Frames:`, `Frame Time:` and one
//! line per frame. Angles are degrees. Rotations are applied in the order of the channels, with the first channel
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
    /// One row per frame: the values of every joint's channels, in order. Angles in radians.
    pub frames: Vec<Vec<f64>>,
}

/// The skeleton and the motion in `text`.
///
/// # Errors
/// If a line does not follow the format, or has an invalid number; the error names the first such line.
pub fn read(text: &str) -> Result<Bvh, BvhError> {
    let mut reader = Reader::new(text);
    reader.word("HIERARCHY")?;
    let joints = reader.hierarchy()?;
    reader.word("MOTION")?;
    let (frame_time, frames) = reader.motion(&joints)?;
    Ok(Bvh {
        joints,
        frame_time,
        frames,
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

    fn motion(&mut self, joints: &[Joint]) -> Result<(f64, Vec<Vec<f64>>), BvhError> {
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
        let mut frames = Vec::new();
        for frame in 0..count {
            let mut row = Vec::with_capacity(channels.len());
            for channel in &channels {
                let value = self.number(&format!("frame {frame}"))?;
                row.push(match channel {
                    Channel::Position(_) => value,
                    Channel::Rotation(_) => value.to_radians(),
                });
            }
            frames.push(row);
        }
        if let Some(&(line, _)) = self.words.peek() {
            self.line = line;
            return Err(self.fault(format!("more numbers than {count} frames take")));
        }
        Ok((time, frames))
    }
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
mod tests {
    use super::*;

    const FILE: &str = "HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 9 -5 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -40 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.008333
1 2 3 90 0 0 0 180 0
1 2 4 0 0 0 0 0 45
";

    #[test]
    fn a_file_is_read_whole() {
        let bvh = read(FILE).expect("reads");
        assert_eq!(bvh.joints.len(), 2);
        let leg = &bvh.joints[1];
        assert_eq!((leg.name.as_str(), leg.parent), ("Left Leg", Some(0)));
        assert_eq!(
            (leg.offset, leg.end),
            ([9.0, -5.0, 0.0], Some([0.0, -40.0, 0.0]))
        );
        assert_eq!(leg.channels[1], Channel::Rotation(0));
        assert_eq!(bvh.frames.len(), 2);
        assert_eq!(bvh.frames[0][2], 3.0);
        assert!((bvh.frames[0][3] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!((bvh.frame_time - 0.008_333).abs() < 1e-12);
    }

    #[test]
    fn each_fault_has_its_line() {
        let cases = [
            (
                "CHANNELS 3 Z",
                "CHANNELS 3 W",
                "line 9: 'wrotation' is not a channel",
            ),
            ("ROOT Hips", "ROOT", "line 3: a joint without a name"),
            (
                "Frames: 2",
                "Frames: 3",
                "line 20: the file ends instead of frame 2",
            ),
            ("Frames: 2", "Frames: 1", "line 20: more numbers"),
            ("Frames: 2", "Frames: 1e30", "line 17: Frames:"),
            (
                "1 2 3 90",
                "1 2 nan 90",
                "line 19: frame 0: 'nan' is not a number",
            ),
            ("0.008333", "0", "line 18: Frame Time"),
            ("HIERARCHY", "", "line 2: 'ROOT' instead of HIERARCHY"),
            (
                "JOINT Left Leg",
                "JOINT Left Leg { JOINT",
                "line 7: a joint without",
            ),
        ];
        for (from, to, expected) in cases {
            let error = read(&FILE.replacen(from, to, 1)).expect_err(expected);
            assert!(
                error.to_string().starts_with(expected),
                "{expected}: {error}"
            );
        }
        for end in 0..FILE.len() - 3 {
            assert!(read(&FILE[..end]).is_err(), "{end}");
        }
    }
}
