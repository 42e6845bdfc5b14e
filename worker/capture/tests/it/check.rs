//! Deliberate errors in the capture of a synthetic person: the check names each of them, and passes the
//! capture without errors.

use std::sync::OnceLock;
use yoto_capture::FrameImage;
use yoto_capture::camera::Camera;
use yoto_capture::check::*;
use yoto_proto::correction::{CameraAxes, Correction, Extrinsics, Mirror};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::{Estimator, SyntheticPerson};

const SIZE: u32 = 96;
const FRAMES: usize = 60;

/// A film by a camera to the front and left, where left and right differ in every frame.
fn film() -> (PoseTrack, Vec<FrameImage>) {
    static FILM: OnceLock<(PoseTrack, Vec<FrameImage>)> = OnceLock::new();
    let made = FILM.get_or_init(|| {
        let person = &SyntheticPerson::cast(1, 5)[0];
        let camera: &Camera = &SyntheticPerson::held_out_cameras(SIZE)[0];
        let poses = person.motion(FRAMES);
        let images = poses.iter().map(|pose| person.render(pose, camera));
        let track = PoseTrack {
            skeleton: person.skeleton(),
            image_size: [SIZE; 2],
            distortion: [0.0; 5],
            fps: 15.0,
            frames: (0..)
                .zip(&poses)
                .map(|(index, pose)| camera.to_frame(index, pose))
                .collect(),
        };
        (track, images.collect())
    });
    made.clone()
}

fn check(track: PoseTrack, images: &[FrameImage]) -> CheckReport {
    let mut checker = Checker::new(track).expect("a skeleton");
    for position in checker.wanted().to_vec() {
        checker.look(position, &images[position]);
    }
    checker.finish()
}

/// The report on the film after `break_it`.
fn broken(break_it: impl FnOnce(&mut PoseTrack, &mut Vec<FrameImage>)) -> CheckReport {
    let (mut track, mut images) = film();
    break_it(&mut track, &mut images);
    check(track, &images)
}

/// The report on the film when its numbers were written as `mistake` reads them.
fn misread(mistake: Correction) -> CheckReport {
    broken(|track, _| *track = mistake.apply(track).expect("applies").track)
}

fn grade(report: &CheckReport, kind: MeasureKind) -> Grade {
    report.measure(kind).expect("measured").grade
}

fn first(report: &CheckReport) -> (&str, &str) {
    let cause = report.causes.first().expect("a cause");
    (&cause.what, &cause.options)
}

fn rotate_masks(images: &mut [FrameImage], by: usize) {
    let masks: Vec<Vec<u8>> = images.iter().map(|it| it.mask.clone()).collect();
    for (i, image) in images.iter_mut().enumerate() {
        image.mask.clone_from(&masks[(i + by) % masks.len()]);
    }
}

#[test]
fn what_is_right_has_no_cause_to_mend() {
    let report = broken(|_, _| {});
    assert!(report.causes.is_empty(), "{:?}", report.causes);
    for kind in [
        MeasureKind::Reading,
        MeasureKind::Timing,
        MeasureKind::BodySize,
        MeasureKind::JointsInMask,
        MeasureKind::MaskInBox,
        MeasureKind::Silhouette,
        MeasureKind::ImageInMask,
        MeasureKind::Masks,
        MeasureKind::Views,
        MeasureKind::Jumps,
        MeasureKind::Duplicates,
        MeasureKind::Blur,
        MeasureKind::Exposure,
    ] {
        let measure = report.measure(kind).expect("measured");
        assert_eq!(measure.grade, Grade::Pass, "{measure:?}");
    }
    assert_eq!(report.pointless(), None);
    assert_eq!((report.frames, report.looked_at), (FRAMES, FRAMES));
    let json = serde_json::to_vec(&report).expect("writes");
    let back: CheckReport = serde_json::from_slice(&json).expect("reads");
    assert_eq!(back.measures.len(), report.measures.len());
}

#[test]
fn misread_numbers_are_named_with_the_option_that_mends_them() {
    let none = Correction::default();
    let quarter = |turn_bodies| Correction {
        turn_bodies,
        ..none
    };
    let mirror = |mirror| Correction { mirror, ..none };
    let c2w = Correction {
        extrinsics: Extrinsics::CameraToWorld,
        ..none
    };
    let opengl = Correction {
        camera_axes: CameraAxes::OpenGl,
        ..none
    };
    let halved = Correction {
        k_scale: 0.5,
        ..none
    };
    for (mistake, options) in [
        (c2w, "--extrinsics c2w"),
        (opengl, "--camera-axes opengl"),
        (halved, "--k-scale 2"),
        (quarter(90.0), "--turn-bodies -90"),
        (mirror(Mirror::Poses), "--mirror poses"),
        (mirror(Mirror::Limbs), "--mirror limbs"),
        (mirror(Mirror::Labels), "--mirror labels"),
    ] {
        let report = misread(mistake);
        assert_eq!(first(&report).1, options, "{:?}", report.tried);
        assert_eq!(grade(&report, MeasureKind::Reading), Grade::Fail);
        assert_eq!(report.grade, Grade::Fail);
        // Mending it as told leaves nothing to mend.
        let mended = report.causes[0].correction.expect("an option");
        let mended = broken(|track, _| {
            let wrong = mistake.apply(track).expect("applies").track;
            *track = mended.apply(&wrong).expect("applies").track;
        });
        assert!(mended.causes.is_empty(), "{options}: {:?}", mended.causes);
    }
}

#[test]
fn units_are_told_apart() {
    let millimetres = |camera: f64, rest: f64| {
        broken(|track, _| {
            for frame in &mut track.frames {
                for row in &mut frame.e[..3] {
                    row[3] *= camera;
                }
                frame.translation = frame.translation.map(|v| v * rest);
            }
            for value in track.skeleton.rest_joints.iter_mut().flatten() {
                *value *= rest;
            }
        })
    };
    let camera = millimetres(1000.0, 1.0);
    assert_eq!(first(&camera).1, "--units camera=mm");
    assert!(first(&camera).0.contains("millimetres"));
    assert!(
        camera
            .pointless()
            .expect("nothing fits")
            .contains("--units")
    );
    assert_eq!(first(&millimetres(100.0, 1.0)).1, "--units camera=cm");
    // Everything in one unit projects as it should; only the size tells.
    let all = millimetres(1000.0, 1000.0);
    assert_eq!(first(&all).1, "--units mm");
    assert_eq!(grade(&all, MeasureKind::BodySize), Grade::Fail);
}

#[test]
fn flipped_images_are_told_from_flipped_poses() {
    let report = broken(|_, images| {
        for image in images {
            for row in image.mask.chunks_exact_mut(SIZE as usize) {
                row.reverse();
            }
            for row in image.rgb.chunks_exact_mut(3 * SIZE as usize) {
                row.as_chunks_mut::<3>().0.reverse();
            }
        }
    });
    assert_eq!(first(&report).1, "--mirror images", "{:?}", report.tried);
}

#[test]
fn shifted_masks_are_told_in_direction_and_from_shifted_poses() {
    let later = broken(|_, images| rotate_masks(images, 1));
    assert_eq!(
        first(&later),
        ("masks come 1 frame early", "--mask-shift -1")
    );
    assert_eq!(grade(&later, MeasureKind::Timing), Grade::Fail);
    assert_eq!(grade(&later, MeasureKind::Reading), Grade::Pass);
    let earlier = broken(|_, images| rotate_masks(images, FRAMES - 2));
    assert_eq!(
        first(&earlier),
        ("masks come 2 frames late", "--mask-shift 2")
    );
    let both = broken(|_, images| images.rotate_left(1));
    assert_eq!(first(&both), ("poses come 1 frame late", "--pose-shift 1"));
}

#[test]
fn two_mistakes_at_once_are_both_named() {
    let report = broken(|track, images| {
        let inverted = Correction {
            extrinsics: Extrinsics::CameraToWorld,
            k_scale: 0.5,
            ..Correction::default()
        };
        *track = inverted.apply(track).expect("applies").track;
        rotate_masks(images, 1);
    });
    let options = report.causes.iter().map(|it| it.options.as_str());
    assert_eq!(
        options.collect::<Vec<_>>(),
        [
            "--extrinsics c2w --k-scale 2",
            "--extrinsics c2w --k-scale 2 --mask-shift -1"
        ]
    );
}

#[test]
fn masks_that_are_inverted_or_empty_fail() {
    let inverted = broken(|_, images| {
        for value in images.iter_mut().flat_map(|it| &mut it.mask) {
            *value = 255 - *value;
        }
    });
    assert!(
        first(&inverted).0.contains("inverted") && first(&inverted).1 == "--mask-kind inverted",
        "{:?}",
        inverted.causes
    );
    assert_eq!(grade(&inverted, MeasureKind::Masks), Grade::Fail);
    let one = broken(|_, images| images[10].mask.fill(0));
    let masks = one.measure(MeasureKind::Masks).expect("measured");
    assert_eq!((masks.grade, &masks.frames[..]), (Grade::Warn, &[10][..]));
    let empty = broken(|_, images| {
        for image in images {
            image.mask.fill(0);
        }
    });
    assert_eq!(grade(&empty, MeasureKind::Masks), Grade::Fail);
    assert_eq!(grade(&empty, MeasureKind::JointsInMask), Grade::Fail);
}

#[test]
fn poor_films_are_graded() {
    let repeated = broken(|_, images| {
        for i in (1..FRAMES).step_by(2) {
            images[i] = images[i - 1].clone();
        }
    });
    let measure = repeated.measure(MeasureKind::Duplicates).expect("measured");
    assert!(measure.value.is_some_and(|it| it > 0.4), "{measure:?}");
    assert_eq!(measure.grade, Grade::Fail);
    let burnt = broken(|_, images| {
        for image in images {
            for (pixel, mask) in image.rgb.chunks_exact_mut(3).zip(&image.mask) {
                pixel.fill(*mask);
            }
        }
    });
    assert_eq!(grade(&burnt, MeasureKind::Exposure), Grade::Fail);
    let frontal = broken(|track, images| {
        track.frames.truncate(5);
        images.truncate(5);
    });
    assert_eq!(grade(&frontal, MeasureKind::Views), Grade::Warn);
    // Most people have a film of one side: what is not seen is guessed, which stops nothing.
    let one_side = broken(|track, images| {
        track.frames.truncate(2);
        images.truncate(2);
    });
    let views = one_side.measure(MeasureKind::Views).expect("measured");
    assert_eq!((views.value, views.grade), (Some(1.0), Grade::Warn));
    let cut = broken(|track, _| {
        for frame in &mut track.frames[30..] {
            frame.translation[0] += 1.5;
        }
    });
    assert_eq!(
        cut.measure(MeasureKind::Jumps).expect("measured").frames,
        [30]
    );
}

#[test]
fn poses_that_wander_are_less_precise() {
    let exact = broken(|_, _| {});
    let wandering = broken(|track, _| {
        for (i, frame) in (0..).zip(&mut track.frames) {
            let time = f64::from(i);
            frame.translation[0] += 0.04 * (0.9 * time).sin();
            frame.translation[1] += 0.04 * (0.7 * time).cos();
        }
    });
    let value = |report: &CheckReport| {
        let measure = report.measure(MeasureKind::Precision).expect("measured");
        measure.value.expect("enough frames")
    };
    let (exact, wandering) = (value(&exact), value(&wandering));
    assert!(wandering > 1.5 * exact, "{exact} {wandering}");

    let (track, images) = film();
    let mut shard = yoto_capture::ShardBuilder::new(track);
    for image in &images {
        shard.push(image).expect("fits");
    }
    let shard = shard.finish().expect("a shard");
    let alone = precision(&shard).expect("a skeleton").expect("frames");
    assert!((alone / exact - 1.0).abs() < 0.2, "{alone} {exact}");
    assert!(alone < PRECISE, "{alone}");
}

#[test]
fn estimated_poses_are_told_from_exact_ones() {
    let value = |report: &CheckReport| {
        let measure = report.measure(MeasureKind::Precision).expect("measured");
        measure.value.expect("enough frames")
    };
    let exact = value(&broken(|_, _| {}));
    for seed in 0..4 {
        let found = value(&broken(|track, _| {
            let estimator = Estimator {
                mistakes: 0.0,
                ..Estimator::default()
            };
            let estimate = estimator.estimate(track, seed);
            *track = estimate.expect("an estimate").track;
        }));
        assert!(exact < PRECISE && found > PRECISE, "{exact} {found}");
    }
    assert!(jumps(&film().0).expect("a skeleton").is_empty());
    let (mut lost, _) = film();
    lost.frames[20].translation[0] += 1.0;
    let index = |at: usize| lost.frames[at].index;
    assert_eq!(jumps(&lost).expect("a skeleton"), [index(20), index(21)]);
}

#[test]
fn few_small_frames_tell_estimated_poses_too() {
    let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(32, 64);
    let estimator = Estimator {
        mistakes: 0.0,
        ..Estimator::default()
    };
    let estimate = estimator.estimate(&track, 1).expect("an estimate").track;
    let value = |track: PoseTrack| {
        let mut shard = yoto_capture::ShardBuilder::new(track);
        for image in &images {
            shard.push(image).expect("fits");
        }
        let shard = shard.finish().expect("a shard");
        precision(&shard).expect("a skeleton").expect("frames")
    };
    let (exact, found) = (value(track), value(estimate));
    assert!(exact < PRECISE && found > PRECISE, "{exact} {found}");
}

#[test]
fn black_clothes_over_black_are_no_fault_and_black_people_are() {
    let painted = |dressed: usize| {
        broken(|_, images| {
            for image in images {
                let first = image.mask.iter().position(|&it| it > 128).expect("a head");
                let from = 3 * SIZE as usize * (first / SIZE as usize + dressed);
                image.rgb[from..].fill(2);
            }
        })
    };
    let suit = painted(14);
    for kind in [MeasureKind::ImageInMask, MeasureKind::Exposure] {
        let measure = suit.measure(kind).expect("measured");
        assert_eq!(measure.grade, Grade::Pass, "{measure:?}");
    }
    assert_eq!(grade(&painted(0), MeasureKind::Exposure), Grade::Fail);
    // What images show beside their masks is still a fault.
    let beside = broken(|_, images| {
        for image in images {
            let legs = image.mask.len() * 75 / 100;
            image.mask[legs..].fill(0);
        }
    });
    let measure = beside.measure(MeasureKind::ImageInMask).expect("measured");
    assert!(measure.grade > Grade::Pass, "{measure:?}");
}

#[test]
fn what_was_not_filmed_is_told_in_words() {
    let all = broken(|_, _| {});
    let said =
        |report: &CheckReport, words: &str| report.advice.iter().any(|it| it.contains(words));
    assert!(!said(&all, "never"), "{:?}", all.advice);
    let front = broken(|track, images| {
        track.frames.truncate(5);
        images.truncate(5);
    });
    assert!(
        said(&front, "never seen: they will be guessed"),
        "{:?}",
        front.advice
    );
    assert!(said(&front, "turn once, slowly"), "{:?}", front.advice);
}

#[test]
fn any_skeleton_and_any_track_can_be_checked() {
    // A single joint, one frame, nobody visible: no measure, no panic.
    let (mut track, images) = film();
    track.frames.truncate(1);
    track.frames[0].pose.truncate(3);
    track.skeleton.names.truncate(1);
    track.skeleton.parents.truncate(1);
    track.skeleton.rest_joints.truncate(1);
    let report = check(track.clone(), &images);
    assert_eq!(report.looked_at, 1);
    let blind = check(track, &[FrameImage::empty(1, 1)]);
    assert_eq!(blind.looked_at, 0);
    assert_eq!(blind.grade, Grade::Fail);
}
