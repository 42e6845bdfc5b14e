//! The visual hull of a person in the canonical pose: the points that forward skinning with the prior's
//! weights puts on the person in every frame, or in nearly every one where poses are inexact. Its
//! shell is where splats start: within a few centimetres of the surface, and nowhere that a frame sees
//! through, so that nothing has to be unlearned in poses that no frame shows.

mod body_depth;
mod cells;
mod shell;

use crate::host::read;
use crate::motion::posed;
use crate::motion::prior::Halo;
use crate::render::RenderError;
use crate::render::splats::body_view;
use crate::train::people::{TrainFrame, TrainSubject};
use body_depth::BodyDepth;
use cells::Cells;
use rayon::prelude::*;
use shell::outward;
use yoto_capture::FrameImage;
use yoto_capture::camera::Pose;
use yoto_ops::warp::inverse::solve::{apply, rigid_inverse};
use yoto_ops::warp::skin::cpu::forward;

pub(crate) use shell::Shell;

/// Most frames that are looked at, evenly over the capture.
const FRAMES: usize = 50;
/// Sum of the bones' Gaussians above which a point may belong to the body (docs/research/splats-experiments.md).
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
/// Quantile of those points' misses that becomes the number of frames that the hull forgives.
const BONES_INSIDE: f64 = 0.9;
/// Largest share of frames that the hull forgives.
const MOST_FORGIVEN: f64 = 0.3;

/// Share of the frames in which a point of a fitted surface may be beside the person, on top of those that the hull forgives.
const BESIDE: f64 = 0.02;
/// Share of the frames with a point of a fitted surface from which it is not on the person, whether or not anything is in its place
/// (docs/research/body.md).
const MOSTLY_BESIDE: f64 = 0.1;

/// A frame, ready to be asked for canonical points.
pub(crate) struct HullFrame {
    /// `[J, 12]` posed body to canonical, of fingers' joints too.
    transforms: Vec<f32>,
    /// Body frame to homogeneous pixels.
    projection: [[f32; 4]; 3],
    /// Pixels per metre at a depth of one metre.
    pub focal: f32,
    /// Body frame to camera.
    pub camera: [[f32; 4]; 3],
    pub image: FrameImage,
}

impl HullFrame {
    /// A frame of one bone in the rest pose, from the origin along the third axis. All of its pixels show the person.
    #[cfg(test)]
    pub(super) fn along_z(size: usize, focal: f32) -> Self {
        let row = |axis: usize| std::array::from_fn(|c| f32::from(u8::from(c == axis)));
        let middle = 0.5 * size as f32;
        Self {
            transforms: [row(0), row(1), row(2)].concat(),
            projection: [[focal, 0.0, middle, 0.0], [0.0, focal, middle, 0.0], row(2)],
            focal,
            camera: [row(0), row(1), row(2)],
            image: FrameImage {
                width: size,
                height: size,
                rgb: vec![0; 3 * size * size],
                mask: vec![255; size * size],
            },
        }
    }

    /// Where a canonical point is that `transform` carries.
    fn sighting(&self, transform: [f32; 12], point: [f32; 3]) -> Sighting {
        let (width, height) = (self.image.width, self.image.height);
        let [x, y, w] = self.project(apply(&transform, point));
        // Comparisons are false for a NaN.
        let inside = w > 0.0 && x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32;
        Sighting {
            pixel: inside.then(|| y as usize * width + x as usize),
            transform,
        }
    }

    /// A point of the posed body, metres, in pixels, and its depth, metres.
    pub(super) fn project(&self, at: [f32; 3]) -> [f32; 3] {
        let [u, v, w] = self
            .projection
            .map(|[a, b, c, d]| a * at[0] + b * at[1] + c * at[2] + d);
        [u / w, v / w, w]
    }

    /// `[J, 12]` posed body to canonical, of fingers' joints too.
    pub(super) fn transforms(&self) -> &[f32] {
        &self.transforms
    }

    /// Coverage of the pixel at a point of the posed body, metres, between pixels by distance, 0 to 255; `None` outside of the picture.
    pub(super) fn coverage(&self, at: [f32; 3]) -> Option<f32> {
        let [x, y, w] = self.project(at);
        let (x, y) = (x - 0.5, y - 0.5);
        let (width, height) = (self.image.width, self.image.height);
        let inside =
            w > 0.0 && x >= 0.0 && y >= 0.0 && x < (width - 1) as f32 && y < (height - 1) as f32;
        inside.then(|| {
            let (column, row) = (x as usize, y as usize);
            let (right, down) = (x - column as f32, y - row as f32);
            let pixel =
                |dx: usize, dy: usize| f32::from(self.image.mask[(row + dy) * width + column + dx]);
            (1.0 - down) * ((1.0 - right) * pixel(0, 0) + right * pixel(1, 0))
                + down * ((1.0 - right) * pixel(0, 1) + right * pixel(1, 1))
        })
    }
}

/// A person's frames, and what forward skinning needs.
pub(crate) struct HullFrames<'a> {
    subject: &'a TrainSubject,
    /// `[K, V]`, the prior.
    weights: Vec<f32>,
    pub frames: Vec<HullFrame>,
}

/// A canonical point in a frame.
#[derive(Clone, Copy)]
pub(crate) struct Sighting {
    /// Index of the pixel; `None` outside the picture or behind the camera.
    pub pixel: Option<usize>,
    /// Canonical to posed body.
    pub transform: [f32; 12],
}

impl<'a> HullFrames<'a> {
    /// The film of a subject: its frames that have a `pose`.
    pub(super) fn new(
        subject: &'a TrainSubject,
        pose: impl Fn(&TrainFrame) -> Option<Pose>,
    ) -> Result<Self, RenderError> {
        let body = &subject.body;
        let weights = read(body.log_prior.clone().inner().exp())?;
        let seen = |(frame, pose): (&'a TrainFrame, Pose)| {
            let body_view = body_view(&body.skeleton, &pose, &frame.camera);
            let [across, down] = body_view.k;
            let row = |k: [f32; 3]| -> [f32; 4] {
                std::array::from_fn(|c| (0..3).map(|r| k[r] * body_view.e[r][c]).sum())
            };
            Ok(HullFrame {
                transforms: read(posed::transforms(body, &pose).inner())?,
                focal: across[0],
                projection: [row(across), row(down), row([0.0, 0.0, 1.0])],
                camera: body_view.e,
                image: subject.image(frame),
            })
        };
        let somebody = |frame: &&TrainFrame| subject.shows(frame, COVERED);
        let frames = subject.frames.iter().filter(somebody);
        let frames: Vec<_> = frames.filter_map(|it| Some((it, pose(it)?))).collect();
        let stride = frames.len().div_ceil(FRAMES).max(1);
        let frames = frames.into_iter().step_by(stride).map(seen);
        Ok(Self {
            subject,
            weights,
            frames: frames.collect::<Result<_, RenderError>>()?,
        })
    }

    /// Finds `points` in a frame.
    pub(super) fn sightings(&self, points: &[[f32; 3]], frame: &HullFrame) -> Vec<Sighting> {
        let body = &self.subject.body;
        let numbers = points.as_flattened();
        let known = &frame.transforms[..12 * body.known_joints];
        let transforms = forward(&self.weights, known, numbers, &body.grid);
        let placed = transforms.as_chunks::<12>().0.par_iter();
        placed
            .zip(points)
            .map(|(transform, point)| frame.sighting(*transform, *point))
            .collect()
    }

    /// Finds `points` in a frame, which bones carry by the weights of a surface.
    pub(super) fn sightings_on_surface(
        &self,
        points: &[[f32; 3]],
        skinning: &[[(u8, f32); 4]],
        frame: &HullFrame,
    ) -> Vec<Sighting> {
        let bones = frame.transforms.as_chunks::<12>().0.iter();
        let forward: Vec<[f32; 12]> = bones.map(rigid_inverse).collect();
        (points.par_iter().zip(skinning))
            .map(|(point, own)| {
                let mut transform = [0f32; 12];
                for (bone, weight) in own {
                    let bone = &forward[usize::from(*bone)];
                    for (to, from) in transform.iter_mut().zip(bone) {
                        *to += weight * from;
                    }
                }
                frame.sighting(transform, *point)
            })
            .collect()
    }

    /// Whether each of the `points`, which bones carry by the weights of a surface, stays on that surface. A point that some frames show
    /// beside the person goes if the `shell` has another one near it, or if those frames are many. Elsewhere it is the best
    /// guess, and without it there is a hole.
    pub(super) fn hold(
        &self,
        points: &[[f32; 3]],
        skinning: &[[(u8, f32); 4]],
        shell: &Shell,
    ) -> Vec<bool> {
        let mut votes = vec![Votes::default(); points.len()];
        for frame in &self.frames {
            let sightings = self.sightings_on_surface(points, skinning, frame);
            let all = votes.iter_mut().zip(sightings);
            all.for_each(|(votes, sighting)| votes.add(frame, sighting));
        }
        let most = self.forgiven() + (BESIDE * self.frames.len() as f64) as usize;
        let holds =
            |(votes, point): (&Votes, &[f32; 3])| votes.hold(most, || shell.is_near(*point));
        votes.par_iter().zip(points).map(holds).collect()
    }

    /// The indices of those `points` that are beside the person in at most `most` frames, and
    /// in how many frames each is where.
    fn votes(&self, mut points: Vec<[f32; 3]>, most: usize) -> Vec<(usize, Votes)> {
        let all = 0..points.len();
        let mut votes: Vec<_> = all.map(|index| (index, Votes::default())).collect();
        for frame in &self.frames {
            for ((_, votes), sighting) in votes.iter_mut().zip(self.sightings(&points, frame)) {
                votes.add(frame, sighting);
            }
            let mut kept = votes.iter().map(|(_, votes)| votes.beside <= most);
            points.retain(|_| kept.next().unwrap_or(false));
            votes.retain(|(_, votes)| votes.beside <= most);
        }
        votes
    }

    /// Number of frames in which a point of the hull may be off the person: the number that covers
    /// [`BONES_INSIDE`] of the points along the bones, which are known to be inside the body. Fingers are too thin to tell.
    pub(super) fn forgiven(&self) -> usize {
        let body = &self.subject.body;
        let skeleton = &body.skeleton;
        let joints = (skeleton.rest.iter().zip(&skeleton.parents)).take(body.known_joints);
        let bones = joints.filter_map(|(end, parent)| Some((end, skeleton.rest[(*parent)?])));
        let points = bones.flat_map(|(end, start)| {
            ALONG.map(|share| {
                std::array::from_fn(|a| (start[a] + share * (end[a] - start[a])) as f32)
            })
        });
        let votes = self.votes(points.collect(), usize::MAX).into_iter();
        let mut misses: Vec<usize> = votes.map(|(_, votes)| votes.beside).collect();
        misses.sort_unstable();
        let most = (MOST_FORGIVEN * self.frames.len() as f64) as usize;
        let rank = (BONES_INSIDE * misses.len().saturating_sub(1) as f64).round() as usize;
        misses.get(rank).copied().unwrap_or(0).min(most)
    }

    /// The cells of the hull, `spacing` metres wide, by their indices.
    fn inside(&self, spacing: f64, forgiven: usize) -> (Cells, Vec<usize>) {
        let cells = Cells::new(&self.subject.body.grid, spacing);
        let halo = Halo::new(&self.subject.body.skeleton);
        let middle = |index: usize| cells.middle(cells.coordinates(index));
        let near: Vec<usize> = (0..cells.count())
            .into_par_iter()
            .filter(|index| halo.at(middle(*index).map(f64::from)) >= HALO)
            .collect();
        let points = near.iter().map(|index| middle(*index)).collect();
        let needed = ((SHOWN * self.frames.len() as f64).ceil() as usize).max(1);
        let votes = self.votes(points, forgiven).into_iter();
        let left = votes.filter(|(_, votes)| votes.on >= needed);
        let left = left.map(|(index, _)| near[index]).collect();
        (cells, left)
    }

    /// The cells of the hull's shell, `spacing` metres wide.
    fn shell(&self, spacing: f64, forgiven: usize, body: &BodyDepth) -> Result<Shell, RenderError> {
        let (cells, mut left) = self.inside(spacing, forgiven);
        if body.bounds() {
            let points = cells.middles(&left);
            let bones = self.bones(&points)?.into_iter();
            let mut held = points
                .into_iter()
                .zip(bones)
                .map(|(point, bone)| body.holds(point, bone));
            left.retain(|_| held.next().unwrap_or(false));
        }
        let mut inside = vec![false; cells.count()];
        for index in &left {
            inside[*index] = true;
        }
        let mut shell = Shell::empty(spacing);
        shell.depth_unseen = body.bounds();
        for index in left {
            let cell = cells.coordinates(index);
            let full = |offset: [isize; 3]| {
                let beside = std::array::from_fn(|a| cell[a].wrapping_add_signed(offset[a]));
                cells.index(beside).is_some_and(|index| inside[index])
            };
            if !SIDES.into_iter().all(full) {
                shell.points.push(cells.middle(cell));
                shell.normals.push(outward(full));
            }
        }
        Ok(shell)
    }

    /// A shell with at least `count` cells and not many more, or the finest that is allowed; without
    /// cells where poses and masks do not agree.
    pub(super) fn shell_of(&self, count: usize) -> Result<Shell, RenderError> {
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
        let (cells, inside) = self.inside(first, forgiven);
        let body = self.depth(cells.middles(&inside))?;
        let mut shell = self.shell(first, forgiven, &body)?;
        if shell.normals.len() < FEWEST {
            return Ok(Shell::empty(first));
        }
        for _ in 0..ROUNDS {
            let found = shell.normals.len();
            if found >= count || shell.spacing <= least {
                break;
            }
            // A surface has cells as the inverse square of their width.
            let finer = shell.spacing * (found as f64 / (SURPLUS * count as f64)).sqrt();
            let next = self.shell(finer.max(least), forgiven, &body)?;
            if next.normals.len() <= found {
                break;
            }
            shell = next;
        }
        Ok(shell)
    }
}

/// Offsets of a cell's neighbours.
const SIDES: [[isize; 3]; 6] = [
    [1, 0, 0],
    [-1, 0, 0],
    [0, 1, 0],
    [0, -1, 0],
    [0, 0, 1],
    [0, 0, -1],
];

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
    fn add(&mut self, frame: &HullFrame, sighting: Sighting) {
        let coverage = sighting.pixel.map(|pixel| frame.image.mask[pixel]);
        match coverage {
            Some(COVERED..) => self.on += 1,
            Some(_) => self.beside += 1,
            None => {}
        }
    }

    /// Whether a point of a fitted surface with these votes stays, which `most` frames may show beside the person. It may be `replaced` by
    /// another point.
    fn hold(self, most: usize, replaced: impl FnOnce() -> bool) -> bool {
        let shown = (self.on + self.beside) as f64;
        self.beside <= most || ((self.beside as f64) < MOSTLY_BESIDE * shown && !replaced())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_doubtful_point_goes_only_if_another_is_in_its_place_or_most_frames_lack_it() {
        let votes = |on, beside| Votes { on, beside };
        assert!(votes(40, 1).hold(1, || true), "few frames");
        assert!(!votes(40, 3).hold(1, || true), "replaced");
        assert!(votes(40, 3).hold(1, || false), "nothing in its place");
        assert!(!votes(30, 10).hold(1, || false), "not on the person");
    }
}
