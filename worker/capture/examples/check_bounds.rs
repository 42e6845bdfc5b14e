//! The bounds of the check of a capture, tested on synthetic people with known poses.
//!
//! `cargo run --release -p yoto-capture --example check_bounds -- [PEOPLE] [PIXELS] [FRAMES] [SEED]`
//!
//! `YOTO_CASES=noise` tries only the mistakes with that word in their names.
//!
//! Films the people of [`SyntheticPerson::varied`], checks each film with its exact poses and with every
//! mistake, and prints for each measure its values in exact films and its number of false alarms, and for
//! each mistake how often it is named.

use rayon::prelude::*;
use std::collections::BTreeMap;
use yoto_capture::FrameImage;
use yoto_capture::camera::Camera;
use yoto_capture::check::{Checker, Grade, Kind, Report, jumps};
use yoto_proto::correction::{CameraAxes, Correction, Extrinsics, Mirror};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::{Estimator, SyntheticPerson};

type Fault = Box<dyn std::error::Error + Send + Sync>;

/// What a report must hold for a mistake to count as found.
enum Found {
    /// A measure that does not pass.
    Doubted(Kind),
    /// A cause with these options, first or beside another.
    Named(&'static str),
}

struct Case {
    name: &'static str,
    mistake: fn(&PoseTrack, u64) -> Result<PoseTrack, Fault>,
    found: Found,
}

fn estimated(track: &PoseTrack, seed: u64, share: f64) -> Result<PoseTrack, Fault> {
    let full = Estimator::default();
    let estimator = Estimator {
        rotation: share * full.rotation,
        bias: share * full.bias,
        across: share * full.across,
        along: share * full.along,
        lean: share * full.lean,
        focal: share * full.focal,
        bones: share * full.bones,
        mistakes: 0.0,
        ..full
    };
    Ok(estimator.estimate(track, seed)?.track)
}

fn misread(track: &PoseTrack, change: impl FnOnce(&mut Correction)) -> Result<PoseTrack, Fault> {
    let mut mistake = Correction::default();
    change(&mut mistake);
    Ok(mistake.apply(track)?.track)
}

fn cases() -> [Case; 10] {
    [
        Case {
            name: "estimator's noise",
            mistake: |track, seed| estimated(track, seed, 1.0),
            found: Found::Doubted(Kind::Precision),
        },
        Case {
            name: "half of that noise",
            mistake: |track, seed| estimated(track, seed, 0.5),
            found: Found::Doubted(Kind::Precision),
        },
        Case {
            name: "poses mirrored",
            mistake: |track, _| misread(track, |it| it.mirror = Mirror::Poses),
            found: Found::Named("--mirror poses"),
        },
        Case {
            name: "limbs mirrored",
            mistake: |track, _| misread(track, |it| it.mirror = Mirror::Limbs),
            found: Found::Named("--mirror limbs"),
        },
        Case {
            name: "two frames lost",
            mistake: |track, seed| {
                let mut track = track.clone();
                let count = track.frames.len();
                let first = 5 + seed as usize % (count / 2);
                for position in [first, first + count / 3] {
                    let other = track.frames[(position + count / 2) % count].pose.clone();
                    let frame = &mut track.frames[position];
                    frame.pose = other;
                    frame.translation[0] += 0.4;
                }
                Ok(track)
            },
            found: Found::Doubted(Kind::Jumps),
        },
        Case {
            name: "extrinsics inverted",
            mistake: |track, _| misread(track, |it| it.extrinsics = Extrinsics::CameraToWorld),
            found: Found::Named("--extrinsics c2w"),
        },
        Case {
            name: "cameras in millimetres",
            mistake: |track, _| {
                let mut track = track.clone();
                for row in track.frames.iter_mut().flat_map(|it| &mut it.e[..3]) {
                    row[3] *= 1000.0;
                }
                Ok(track)
            },
            found: Found::Named("--units camera=mm"),
        },
        Case {
            name: "axes of OpenGL",
            mistake: |track, _| misread(track, |it| it.camera_axes = CameraAxes::OpenGl),
            found: Found::Named("--camera-axes opengl"),
        },
        Case {
            name: "K of half the size",
            mistake: |track, _| misread(track, |it| it.k_scale = 0.5),
            found: Found::Named("--k-scale 2"),
        },
        Case {
            name: "poses a frame late",
            mistake: |track, _| {
                let mut late = track.clone();
                for (frame, before) in late.frames.iter_mut().skip(1).zip(&track.frames) {
                    frame.pose.clone_from(&before.pose);
                    frame.translation = before.translation;
                }
                Ok(late)
            },
            found: Found::Named("--pose-shift 1"),
        },
    ]
}

impl Found {
    fn is_in(&self, report: &Report) -> bool {
        match self {
            Self::Doubted(kind) => doubts(report, *kind),
            Self::Named(options) => report.causes.iter().any(|cause| {
                let alternatives = cause.alternatives.iter().map(String::as_str);
                std::iter::once(cause.options.as_str())
                    .chain(alternatives)
                    .any(|it| it == *options)
            }),
        }
    }
}

fn doubts(report: &Report, kind: Kind) -> bool {
    report
        .measure(kind)
        .is_some_and(|measure| measure.grade != Grade::Pass)
}

/// A camera before one person in two, and anywhere around the others.
fn camera(person: usize, size: u32) -> Camera {
    let steps = person as f64 * 0.618_034;
    let angle = if person.is_multiple_of(2) {
        0.0
    } else {
        std::f64::consts::TAU * steps
    };
    let (distance, height) = (2.8 + steps.fract(), 1.15 + 0.7 * (3.0 * steps).fract());
    let eye = [distance * angle.sin(), height, distance * angle.cos()];
    let focal = f64::from(size) * distance / 2.5;
    Camera::look_at(eye, [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], focal, size, size)
}

fn film(person: &SyntheticPerson, camera: &Camera, frames: usize) -> (PoseTrack, Vec<FrameImage>) {
    let poses = person.motion(frames);
    let images = poses.iter().map(|pose| person.render(pose, camera));
    let track = PoseTrack {
        skeleton: person.skeleton(),
        image_size: [camera.width, camera.height],
        fps: 15.0,
        distortion: [0.0; 5],
        frames: (0..)
            .zip(&poses)
            .map(|(index, pose)| camera.to_frame(index, pose))
            .collect(),
    };
    (track, images.collect())
}

fn check(track: PoseTrack, images: &[FrameImage]) -> Result<Report, Fault> {
    let mut checker = Checker::new(track)?;
    for position in checker.wanted().to_vec() {
        checker.look(position, &images[position]);
    }
    Ok(checker.finish())
}

/// Frames with false jumps per person, in jumping jacks at two per second and squats: fast motion, but without
/// jumps of the tracking.
fn jumps_in_fast_motion(cast: &[SyntheticPerson], fps: usize) -> Result<Vec<usize>, Fault> {
    let camera = camera(0, 96);
    let found = cast.iter().map(|person| {
        let poses = (0..).zip(person.unseen_motion(2 * fps));
        let track = PoseTrack {
            skeleton: person.skeleton(),
            image_size: [camera.width, camera.height],
            fps: fps as f64,
            distortion: [0.0; 5],
            frames: poses.map(|(i, pose)| camera.to_frame(i, &pose)).collect(),
        };
        Ok(jumps(&track)?.len())
    });
    found.collect()
}

fn quantiles(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
        values.get(index).copied().unwrap_or(f64::NAN)
    };
    [0.0, 0.05, 0.5, 0.95, 1.0]
        .map(|share| format!("{:>9.4}", at(share)))
        .concat()
}

fn main() -> Result<(), Fault> {
    let mut numbers = [48, 96, 100, 1];
    for (number, argument) in numbers.iter_mut().zip(std::env::args().skip(1)) {
        *number = argument.parse()?;
    }
    let [people, size, frames, seed] = numbers;
    let cast = SyntheticPerson::varied(people, seed as u64);
    let cases = cases();
    let only = std::env::var("YOTO_CASES").ok();
    let wanted = |name: &str| only.as_ref().is_none_or(|it| name.contains(it.as_str()));
    let found: Vec<(Report, Vec<Report>)> = cast
        .par_iter()
        .enumerate()
        .map(|(i, person)| {
            let (track, images) = film(person, &camera(i, size as u32), frames);
            let with = cases.iter().filter(|it| wanted(it.name)).map(|case| {
                let wrong = (case.mistake)(&track, seed as u64 * 1000 + i as u64)?;
                check(wrong, &images)
            });
            let with = with.collect::<Result<_, Fault>>()?;
            Ok((check(track, &images)?, with))
        })
        .collect::<Result<_, Fault>>()?;

    println!("{people} people, {frames} frames of {size} pixels, seed {seed}\n");
    println!("exact poses: false alarms, and the figure's least, 5 %, median, 95 %, most");
    let mut kinds: BTreeMap<usize, Kind> = BTreeMap::new();
    if let Some((report, _)) = found.first() {
        kinds = report
            .measures
            .iter()
            .map(|it| it.kind)
            .enumerate()
            .collect();
    }
    for kind in kinds.into_values() {
        let alarms = found
            .iter()
            .filter(|(exact, _)| doubts(exact, kind))
            .count();
        let values = found
            .iter()
            .filter_map(|(exact, _)| exact.measure(kind)?.value);
        println!(
            "{:<24}{alarms:>4}  {}",
            kind.title(),
            quantiles(values.collect())
        );
    }
    println!("\nfast motion without jumps: people with false jumps, and frames with them");
    for fps in [15, 30, 60] {
        let found = jumps_in_fast_motion(&cast, fps)?;
        let people = found.iter().filter(|jumps| **jumps > 0).count();
        println!(
            "{fps:>2} frames per second{people:>10}{:>6}",
            found.iter().sum::<usize>()
        );
    }

    println!("\nmistakes: missed, and the figure of what should tell them");
    for (at, case) in cases.iter().filter(|it| wanted(it.name)).enumerate() {
        let reports: Vec<&Report> = found.iter().map(|(_, with)| &with[at]).collect();
        let missed = reports.iter().filter(|it| !case.found.is_in(it)).count();
        let kind = match (&case.found, case.name) {
            (Found::Doubted(kind), _) => *kind,
            (_, "poses a frame late") => Kind::Timing,
            _ => Kind::Reading,
        };
        let values = reports.iter().filter_map(|it| it.measure(kind)?.value);
        println!(
            "{:<24}{missed:>4}  {}",
            case.name,
            quantiles(values.collect())
        );
    }
    Ok(())
}
