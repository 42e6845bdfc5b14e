//! The error of a picture by region: on parts of the body, along its outline, or as haze around it.
//! The mean error of a picture does not tell a blurred face from a ragged outline.

use crate::motion::prior::is_torso;
use serde::{Deserialize, Serialize};
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::smpl::joints_of_body;

/// Half the width of the outline is the picture's longest side divided by this: 4 of 512 pixels.
const OUTLINE: usize = 128;
/// Coverage from which a pixel counts as the person.
const HALF: u8 = 128;

/// A region of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Region {
    /// Head and neck.
    Head,
    /// Hands.
    Hands,
    /// From hips to collar bones.
    Torso,
    /// Arms and legs.
    Limbs,
    /// Both sides of the person's outline.
    Outline,
    /// The picture around the person and the outline.
    Around,
}

impl Region {
    /// All regions, in the order of their numbers.
    pub const ALL: [Self; 6] = [
        Self::Head,
        Self::Hands,
        Self::Torso,
        Self::Limbs,
        Self::Outline,
        Self::Around,
    ];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Hands => "hands",
            Self::Torso => "torso",
            Self::Limbs => "limbs",
            Self::Outline => "outline",
            Self::Around => "around",
        }
    }

    /// The part of the body that a joint's bones belong to, by the joint's name.
    fn of_joint(name: &str) -> Self {
        let lower = name.to_ascii_lowercase();
        let has = |parts: &[&str]| parts.iter().any(|part| lower.contains(part));
        if has(&["head", "neck", "jaw", "eye"]) {
            Self::Head
        } else if has(&["hand", "wrist", "finger", "thumb"]) {
            Self::Hands
        } else if is_torso(name) {
            Self::Torso
        } else {
            Self::Limbs
        }
    }
}

/// Error of one region, over any number of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionError {
    /// The region.
    pub region: Region,
    /// Share of the pictures' squared error, 0 to 1.
    pub share_of_error: f64,
    /// Share of the pictures' pixels, 0 to 1.
    pub share_of_pixels: f64,
    /// PSNR inside the region, dB; absent if it has no error.
    pub psnr: Option<f64>,
    /// Mean opacity of the render, 0 to 1.
    pub opacity: f64,
}

/// Sums over the regions of pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegionSums {
    sums: [Sum; Region::ALL.len()],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sum {
    pixels: u64,
    /// Mean squared error of a pixel's colours, in units of the data range.
    squares: f64,
    opacity: f64,
}

impl RegionSums {
    /// The sums of one picture: a render's 8-bit colours `rgb` and its `opacity` against the truth,
    /// which shows a body of `skeleton` in `pose`. All have the truth's size.
    pub fn of(
        truth: &FrameImage,
        rgb: &[u8],
        opacity: &[f32],
        skeleton: &Skeleton,
        pose: &Pose,
        camera: &Camera,
    ) -> Self {
        let mut found = Self::default();
        let pairs = truth.rgb.chunks_exact(3).zip(rgb.chunks_exact(3));
        let regions = regions(truth, skeleton, pose, camera);
        for ((region, (real, seen)), opacity) in regions.iter().zip(pairs).zip(opacity) {
            let sum = &mut found.sums[*region as usize];
            let square = |c: usize| ((f64::from(real[c]) - f64::from(seen[c])) / 255.0).powi(2);
            sum.pixels += 1;
            sum.squares += (square(0) + square(1) + square(2)) / 3.0;
            sum.opacity += f64::from(*opacity);
        }
        found
    }

    /// Adds the sums of other pictures.
    pub fn add(&mut self, other: &Self) {
        for (sum, other) in self.sums.iter_mut().zip(&other.sums) {
            sum.pixels += other.pixels;
            sum.squares += other.squares;
            sum.opacity += other.opacity;
        }
    }

    /// The errors of the regions that the pictures have.
    pub fn errors(&self) -> Vec<RegionError> {
        let pixels: u64 = self.sums.iter().map(|sum| sum.pixels).sum();
        let squares: f64 = self.sums.iter().map(|sum| sum.squares).sum();
        let present = Region::ALL.into_iter().zip(&self.sums);
        present
            .filter(|(_, sum)| sum.pixels > 0)
            .map(|(region, sum)| RegionError {
                region,
                share_of_error: if squares > 0.0 {
                    sum.squares / squares
                } else {
                    0.0
                },
                share_of_pixels: sum.pixels as f64 / pixels as f64,
                psnr: (sum.squares > 0.0)
                    .then(|| -10.0 * (sum.squares / sum.pixels as f64).log10()),
                opacity: sum.opacity / sum.pixels as f64,
            })
            .collect()
    }
}

/// The region of each pixel, row by row. Inside the outline, a pixel belongs to the part of the body
/// whose bone is nearest in the picture.
fn regions(truth: &FrameImage, skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Vec<Region> {
    let (width, height) = (truth.width, truth.height);
    let bones = bones(skeleton, pose, camera);
    let outline = outline(&truth.mask, width, height);
    let region = |pixel: usize| {
        if outline[pixel] {
            return Region::Outline;
        }
        if truth.mask[pixel] < HALF {
            return Region::Around;
        }
        let at = [(pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5];
        let nearest = bones.iter().min_by(|one, other| {
            let away = |bone: &Bone| square_to_segment(at, bone.from, bone.to);
            away(one).total_cmp(&away(other))
        });
        nearest.map_or(Region::Torso, |bone| bone.region)
    };
    (0..width * height).map(region).collect()
}

/// A bone in a picture, pixels.
struct Bone {
    region: Region,
    from: [f64; 2],
    to: [f64; 2],
}

/// The bones in front of the camera; a joint without children is a bone without length. Fingers belong to the bone of their hand, so that
/// regions of people with and without them compare.
fn bones(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Vec<Bone> {
    let joints = skeleton.posed_joints(pose);
    let seen: Vec<Option<[f64; 2]>> = joints.iter().map(|j| camera.project(*j)).collect();
    let children = skeleton.children();
    let known = joints_of_body(skeleton);
    let mut bones = Vec::new();
    for (joint, name) in skeleton.names.iter().enumerate().take(known) {
        let region = Region::of_joint(name);
        let itself = [joint];
        let ends: &[usize] = match children[joint].as_slice() {
            [] => &itself,
            some => some,
        };
        for &end in ends.iter().filter(|end| **end < known) {
            if let (Some(from), Some(to)) = (seen[joint], seen[end]) {
                bones.push(Bone { region, from, to });
            }
        }
    }
    bones
}

/// Squared distance from a point to a segment.
fn square_to_segment(at: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let offset = [at[0] - from[0], at[1] - from[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    let share = match length > 0.0 {
        true => ((offset[0] * along[0] + offset[1] * along[1]) / length).clamp(0.0, 1.0),
        false => 0.0,
    };
    (offset[0] - share * along[0]).powi(2) + (offset[1] - share * along[1]).powi(2)
}

/// Whether each pixel is near a change between person and surroundings.
fn outline(mask: &[u8], width: usize, height: usize) -> Vec<bool> {
    let reach = width.max(height).div_ceil(OUTLINE) as isize;
    let person = |x: usize, y: usize| mask[y * width + x] >= HALF;
    let mut near = vec![false; width * height];
    for y in 0..height {
        for x in 0..width {
            let changes = (x + 1 < width && person(x, y) != person(x + 1, y))
                || (y + 1 < height && person(x, y) != person(x, y + 1));
            if !changes {
                continue;
            }
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let (u, v) = (x as isize + dx, y as isize + dy);
                    let inside =
                        (0..width as isize).contains(&u) && (0..height as isize).contains(&v);
                    if inside && dx * dx + dy * dy <= reach * reach {
                        near[v as usize * width + u as usize] = true;
                    }
                }
            }
        }
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    /// A pose and a camera that see a person of the default cast whole, and the picture's truth.
    fn scene() -> (Skeleton, Pose, Camera, FrameImage) {
        let person = SyntheticPerson::cast(1, 7).remove(0);
        let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
        let pose = person.motion(4).remove(0);
        let camera = SyntheticPerson::train_camera(160);
        let truth = person.render(&pose, &camera);
        (skeleton, pose, camera, truth)
    }

    #[test]
    fn an_error_is_found_in_its_region() {
        let (skeleton, pose, camera, truth) = scene();
        let head = skeleton.names.iter().position(|name| name.contains("head"));
        let head = head.expect("a head");
        let joint = skeleton.posed_joints(&pose)[head];
        let [x, y] = camera.project(joint).expect("in front");
        let mut rgb = truth.rgb.clone();
        let pixel = y as usize * truth.width + x as usize;
        rgb[3 * pixel] ^= 0x80;
        let opacity = vec![0.25; truth.width * truth.height];
        let mut sums = RegionSums::of(&truth, &rgb, &opacity, &skeleton, &pose, &camera);
        sums.add(&sums.clone());
        let errors = sums.errors();
        let of = |region| {
            errors
                .iter()
                .find(|it| it.region == region)
                .expect("present")
        };
        assert_eq!(of(Region::Head).share_of_error, 1.0);
        assert_eq!(of(Region::Around).psnr, None);
        assert!((of(Region::Around).opacity - 0.25).abs() < 1e-6);
        let shares: f64 = errors.iter().map(|it| it.share_of_pixels).sum();
        assert!((shares - 1.0).abs() < 1e-9);
        for region in [Region::Torso, Region::Limbs, Region::Outline] {
            assert!(of(region).share_of_pixels > 1e-3, "{region:?}");
        }
    }
}
