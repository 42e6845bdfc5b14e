//! The background behind a person, where a camera stands still.

use super::shift::{Pyramid, Shift};
use super::{Rgb, band};
use crate::Picture;

/// Colours this far apart in a channel are of different things, levels. Noise and compression are below it.
const SAME: f32 = 14.0;
/// A background pixel must be seen in at least this number of frames.
const FEWEST: u8 = 3;
/// Smallest share of the frames that agree on a colour.
const AGREE: f32 = 0.6;
/// Reach of a mask's errors, as a share of the picture's longer side.
const REACH: f32 = 0.02;

/// Learns a background from frames, one at a time. Holds one picture: each pixel's majority colour (Boyer and Moore's
/// vote, in which close colours agree and are averaged).
#[derive(Debug)]
pub struct BackgroundBuilder {
    size: [usize; 2],
    colours: Vec<Rgb>,
    votes: Vec<u8>,
    seen: Vec<u8>,
    /// The first frame, which others are aligned with.
    first: Option<Pyramid>,
}

/// Colours of a background, where they are known, pixel by pixel.
#[derive(Debug)]
pub struct KnownBackground {
    size: [usize; 2],
    pub(super) colours: Vec<Option<[u8; 3]>>,
    brightness: Pyramid,
}

/// A known background at the place where one frame shows it, since the camera may have turned a little.
pub(super) struct Plate<'a> {
    known: &'a KnownBackground,
    shift: Shift,
}

impl BackgroundBuilder {
    /// A background of `width` by `height` pixels, all unknown.
    pub fn new(width: usize, height: usize) -> Self {
        let area = width * height;
        Self {
            size: [width, height],
            colours: vec![[0.0; 3]; area],
            votes: vec![0; area],
            seen: vec![0; area],
            first: None,
        }
    }

    /// Adds the pixels of a frame that are not near its `mask`.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn add(&mut self, picture: &Picture, mask: &[u8]) {
        let [width, height] = self.size;
        assert_eq!([picture.width, picture.height], self.size);
        let reach = (width.max(height) as f32 * REACH).ceil() as usize;
        let near = band::near(mask, [width, height], reach);
        let pixels = picture.rgb.as_chunks::<3>().0;
        let own = Pyramid::new([width, height], |at| (!near[at]).then(|| pixels[at]));
        let shift = match &self.first {
            Some(first) => own.shift_to(first),
            None => Shift::default(),
        };
        self.first.get_or_insert(own);
        for (at, pixel) in pixels.iter().enumerate().filter(|(at, _)| !near[*at]) {
            let Some(at) = shift.of(at, [width, height]) else {
                continue;
            };
            let colour = pixel.map(f32::from);
            let mean = &mut self.colours[at];
            let votes = &mut self.votes[at];
            self.seen[at] = self.seen[at].saturating_add(1);
            let same = (0..3).all(|c| (colour[c] - mean[c]).abs() < SAME);
            if *votes == 0 {
                (*mean, *votes) = (colour, 1);
            } else if same {
                *votes = votes.saturating_add(1);
                for channel in 0..3 {
                    mean[channel] += (colour[channel] - mean[channel]) / f32::from(*votes);
                }
            } else {
                *votes -= 1;
            }
        }
    }

    /// The background that the frames agree on.
    pub fn finish(self) -> KnownBackground {
        let counts = self.votes.iter().zip(&self.seen);
        let colour = |(colour, (&votes, &seen)): (&Rgb, (&u8, &u8))| {
            let agreed = seen >= FEWEST && f32::from(votes) >= AGREE * f32::from(seen);
            agreed.then(|| colour.map(|it| it.round() as u8))
        };
        let colours: Vec<_> = self.colours.iter().zip(counts).map(colour).collect();
        KnownBackground {
            size: self.size,
            brightness: Pyramid::new(self.size, |at| colours[at]),
            colours,
        }
    }
}

impl KnownBackground {
    /// The background of a frame of these `pixels`, which shows it where `free` says so.
    pub(super) fn behind(&self, pixels: &[[u8; 3]], free: &[bool]) -> Plate<'_> {
        let own = Pyramid::new(self.size, |at| free[at].then(|| pixels[at]));
        Plate {
            known: self,
            shift: own.shift_to(&self.brightness),
        }
    }

    /// Share of the pixels that are known.
    pub fn share(&self) -> f64 {
        let known = self.colours.iter().flatten().count();
        known as f64 / self.colours.len().max(1) as f64
    }
}

impl Plate<'_> {
    /// The colour at a pixel of the frame, if it is known.
    pub(super) fn at(&self, pixel: usize) -> Option<[u8; 3]> {
        let at = self.shift.of(pixel, self.known.size)?;
        self.known.colours.get(at).copied().flatten()
    }
}
