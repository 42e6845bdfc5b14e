//! The visual hull of a person in the canonical pose: the points that forward skinning with the prior's
//! weights puts on the person in every frame, or in nearly every one where poses are inexact. Its
//! shell is where splats start: within a few centimetres of the surface, and nowhere that a frame sees
//! through, so that nothing has to be unlearned in poses that no frame shows.

use super::people::{TrainFrame, TrainSubject};
use crate::motion::posed;
use crate::motion::prior::Halo;
use crate::ops::warp::skin::cpu::forward;
use crate::render::RenderError;
use crate::render::frame::read;
use crate::render::splats::sight;
use rayon::prelude::*;
use yoto_capture::FrameImage;

/// Most frames that are looked at, evenly over the capture.
const FRAMES: usize = 50;
/// Sum of the bones' Gaussians above which a point may belong to the body (docs/splats.md).
const HALO: f64 = 0.05;
/// Share of the frames that must show a point on the person. In the others, it may be outside the
/// picture.
const SHOWN: f64 = 0.1;
/// Width of the first cells that are tried, and the least, metres.
const CELLS: [f64; 2] = [0.02, 0.003];
/// Most cells of the box.
const MOST_CELLS: f64 = 3e7;
/// Cells of [`CELLS`]'s first width on the shell of the smallest person: poses and masks of a smaller
/// one do not agree.
const FEWEST: usize = 100;
/// Coverage from which a pixel shows the person.
const COVERED: u8 = 100;
/// Points along each bone that tell how exact poses and masks are.
const ALONG: [f64; 3] = [0.25, 0.5, 0.75];
/// Share of those points that are on the person in all frames but as many as the hull forgives.
const BONES_INSIDE: f64 = 0.9;
/// Largest share of frames that the hull forgives.
const MOST_FORGIVEN: f64 = 0.3;

/// A frame, ready to be asked for canonical points.
pub(super) struct Seen<'a> {
    /// `[K, 12]` posed body to canonical.
    transforms: Vec<f32>,
    /// Body frame to homogeneous pixels.
    projection: [[f32; 4]; 3],
    /// Body frame to camera.
    pub camera: [[f32; 4]; 3],
    pub image: &'a FrameImage,
}

/// A person's frames, and what forward skinning needs.
pub(super) struct Film<'a> {
    subject: &'a TrainSubject,
    /// `[K, V]`, the prior.
    weights: Vec<f32>,
    pub frames: Vec<Seen<'a>>,
}

/// A canonical point in a frame.
#[derive(Clone, Copy)]
pub(super) struct Sighting {
    /// Index of the pixel; `None` outside the picture or behind the camera.
    pub pixel: Option<usize>,
    /// Canonical to posed body.
    pub transform: [f32; 12],
}

impl<'a> Film<'a> {
    /// The film of a subject.
    pub fn new(subject: &'a TrainSubject) -> Result<Self, RenderError> {
        let body = &subject.body;
        let weights = read(body.log_prior.clone().inner().exp())?;
        let stride = subject.frames.len().div_ceil(FRAMES).max(1);
        let seen = |frame: &'a TrainFrame| {
            let sight = sight(&body.skeleton, &frame.pose, &frame.camera);
            let [across, down] = sight.k;
            let row = |k: [f32; 3]| -> [f32; 4] {
                std::array::from_fn(|c| (0..3).map(|r| k[r] * sight.e[r][c]).sum())
            };
            Ok(Seen {
                transforms: read(posed::transforms(body, &frame.pose).inner())?,
                projection: [row(across), row(down), row([0.0, 0.0, 1.0])],
                camera: sight.e,
                image: &frame.image,
            })
        };
        let somebody = |frame: &&TrainFrame| frame.image.mask.iter().any(|m| *m >= COVERED);
        let frames = subject.frames.iter().step_by(stride);
        let frames = frames.filter(somebody).map(seen);
        Ok(Self {
            subject,
            weights,
            frames: frames.collect::<Result<_, RenderError>>()?,
        })
    }

    /// Where `points` `[N, 3]` are in a frame.
    pub fn sightings(&self, points: &[f32], frame: &Seen<'_>) -> Vec<Sighting> {
        let grid = &self.subject.body.grid;
        let transforms = forward(&self.weights, &frame.transforms, points, grid);
        let (width, height) = (frame.image.width, frame.image.height);
        let placed = transforms.as_chunks::<12>().0.par_iter();
        placed
            .zip(points.as_chunks::<3>().0)
            .map(|(transform, point)| {
                let at = carried(transform, *point);
                let [u, v, w] = frame
                    .projection
                    .map(|[a, b, c, d]| a * at[0] + b * at[1] + c * at[2] + d);
                let (x, y) = (u / w, v / w);
                // Comparisons are false for a NaN.
                let inside =
                    w > 0.0 && x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32;
                Sighting {
                    pixel: inside.then(|| y as usize * width + x as usize),
                    transform: *transform,
                }
            })
            .collect()
    }

    /// In how many frames each of `points` is on the person and beside.
    fn votes(&self, points: &[f32]) -> Vec<Votes> {
        let mut votes = vec![Votes::default(); points.len() / 3];
        for frame in &self.frames {
            for (votes, sighting) in votes.iter_mut().zip(self.sightings(points, frame)) {
                votes.add(frame, sighting);
            }
        }
        votes
    }

    /// Number of frames in which a point of the hull may be off the person: as many as most of the
    /// skeleton's bones are, which are inside the body.
    fn forgiven(&self) -> usize {
        let skeleton = &self.subject.body.skeleton;
        let joints = skeleton.rest.iter().zip(&skeleton.parents);
        let bones = joints.filter_map(|(end, parent)| Some((end, skeleton.rest[(*parent)?])));
        let points: Vec<f32> = bones
            .flat_map(|(end, start)| {
                ALONG.map(|share| {
                    std::array::from_fn::<f32, 3, _>(|a| {
                        (start[a] + share * (end[a] - start[a])) as f32
                    })
                })
            })
            .flatten()
            .collect();
        let votes = self.votes(&points).into_iter();
        let mut misses: Vec<usize> = votes.map(|votes| votes.beside).collect();
        misses.sort_unstable();
        let most = (MOST_FORGIVEN * self.frames.len() as f64) as usize;
        let place = (BONES_INSIDE * misses.len().saturating_sub(1) as f64).round() as usize;
        misses.get(place).copied().unwrap_or(0).min(most)
    }

    /// The cells of the hull's shell, `spacing` metres wide.
    fn shell(&self, spacing: f64, forgiven: usize) -> Shell {
        let grid = &self.subject.body.grid;
        let halo = Halo::new(&self.subject.body.skeleton);
        let dims: [usize; 3] = std::array::from_fn(|a| {
            (f64::from(grid.max[a] - grid.min[a]) / spacing).ceil() as usize
        });
        let cell = |index: usize| {
            let place = [
                index % dims[0],
                index / dims[0] % dims[1],
                index / (dims[0] * dims[1]),
            ];
            std::array::from_fn::<f64, 3, _>(|a| {
                f64::from(grid.min[a]) + spacing * (place[a] as f64 + 0.5)
            })
        };
        let mut left: Vec<usize> = (0..dims.iter().product())
            .into_par_iter()
            .filter(|index| halo.at(cell(*index)) >= HALO)
            .collect();
        let mut votes = vec![Votes::default(); left.len()];
        for frame in &self.frames {
            let points: Vec<f32> = left
                .iter()
                .flat_map(|index| cell(*index).map(|v| v as f32))
                .collect();
            for (votes, sighting) in votes.iter_mut().zip(self.sightings(&points, frame)) {
                votes.add(frame, sighting);
            }
            let mut kept = votes.iter().map(|votes| votes.beside <= forgiven);
            left.retain(|_| kept.next().unwrap_or(false));
            votes.retain(|votes| votes.beside <= forgiven);
        }
        let needed = ((SHOWN * self.frames.len() as f64).ceil() as usize).max(1);
        let mut kept = votes.iter().map(|votes| votes.on >= needed);
        left.retain(|_| kept.next().unwrap_or(false));
        let mut inside = vec![false; dims.iter().product()];
        for index in &left {
            inside[*index] = true;
        }
        let full = |index: usize, offset: [isize; 3]| {
            let place = [
                index % dims[0],
                index / dims[0] % dims[1],
                index / (dims[0] * dims[1]),
            ];
            let at: [usize; 3] = std::array::from_fn(|a| place[a].wrapping_add_signed(offset[a]));
            (0..3).all(|a| at[a] < dims[a]) && inside[(at[2] * dims[1] + at[1]) * dims[0] + at[0]]
        };
        let mut shell = Shell::empty(spacing);
        for index in left {
            let beside = (0..6).map(|side| {
                let mut offset = [0isize; 3];
                offset[side / 2] = if side % 2 == 0 { 1 } else { -1 };
                offset
            });
            if beside.into_iter().all(|offset| full(index, offset)) {
                continue;
            }
            shell.points.extend(cell(index).map(|v| v as f32));
            shell.normals.push(outward(|offset| full(index, offset)));
        }
        shell
    }

    /// A shell with at least `count` cells and not many more, or the finest that is allowed; without
    /// cells where poses and masks do not agree.
    pub fn shell_of(&self, count: usize) -> Shell {
        /// Most shells that are tried.
        const ROUNDS: usize = 6;
        /// Cells that are asked for, as a multiple of those needed.
        const SURPLUS: f64 = 1.1;
        let grid = &self.subject.body.grid;
        let volume: f64 = (0..3)
            .map(|a| f64::from(grid.max[a] - grid.min[a]))
            .product();
        let [first, least] = CELLS.map(|width| width.max((volume / MOST_CELLS).cbrt()));
        let forgiven = self.forgiven();
        let mut shell = self.shell(first, forgiven);
        if shell.normals.len() < FEWEST {
            return Shell::empty(first);
        }
        for _ in 0..ROUNDS {
            let found = shell.normals.len();
            if found >= count || shell.spacing <= least {
                break;
            }
            // A surface has cells as the inverse square of their width.
            let finer = shell.spacing * (found as f64 / (SURPLUS * count as f64)).sqrt();
            let next = self.shell(finer.max(least), forgiven);
            if next.normals.len() <= found {
                break;
            }
            shell = next;
        }
        shell
    }
}

/// In how many frames a point is where.
#[derive(Clone, Copy, Default)]
struct Votes {
    /// On the person.
    on: usize,
    /// In the picture, beside the person.
    beside: usize,
}

impl Votes {
    /// Counts a frame. One that does not contain the point says nothing.
    fn add(&mut self, frame: &Seen<'_>, sighting: Sighting) {
        let coverage = sighting.pixel.map(|pixel| frame.image.mask[pixel]);
        match coverage {
            Some(COVERED..) => self.on += 1,
            Some(_) => self.beside += 1,
            None => {}
        }
    }
}

/// Cells of a hull with a neighbour outside.
pub(super) struct Shell {
    /// Their width, metres.
    pub spacing: f64,
    /// `[N, 3]` middles, metres.
    pub points: Vec<f32>,
    /// `[N]` unit normals, outward.
    pub normals: Vec<[f32; 3]>,
}

impl Shell {
    fn empty(spacing: f64) -> Self {
        Self {
            spacing,
            points: Vec::new(),
            normals: Vec::new(),
        }
    }
}

/// The mean direction of the cells outside, among those within two cells; up where there is none.
fn outward(full: impl Fn([isize; 3]) -> bool) -> [f32; 3] {
    let mut sum = [0f32; 3];
    for z in -2..=2isize {
        for y in -2..=2isize {
            for x in -2..=2isize {
                if !full([x, y, z]) {
                    for (sum, part) in sum.iter_mut().zip([x, y, z]) {
                        *sum += part as f32;
                    }
                }
            }
        }
    }
    let length = sum.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length > 0.0 {
        sum.map(|v| v / length)
    } else {
        [0.0, 1.0, 0.0]
    }
}

/// `point` where `transform` puts it.
pub(super) fn carried(transform: &[f32; 12], point: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|r| {
        let row = &transform[4 * r..4 * r + 4];
        row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3]
    })
}
