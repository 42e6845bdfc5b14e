//! Orders to render.

use super::scene::MAX_PICTURES;
use super::{Fault, Faults, scene};
use crate::render_needs::{model_of, other_models};
use crate::tiers;
use crate::v1::render_quality::Want;
use crate::v1::render_spec::What;
use crate::v1::{Between, Layer, RenderQuality, RenderSpec, Scene};
use std::ops::RangeInclusive;

/// Frame rates of an animation, per second; 0 leaves it to the worker.
const RATES: RangeInclusive<f32> = 0.0..=120.0;
/// Mixtures of two people in one render.
const MIXTURES: RangeInclusive<usize> = 1..=100;

/// All faults of an order to render.
pub fn faults(render: &RenderSpec) -> Vec<Fault> {
    let mut found = Faults::default();
    check_background(&mut found, render);
    found.between("fps", render.fps, &RATES);
    if let Some(quality) = &render.quality {
        check_quality(&mut found, quality);
    }
    check_layer(&mut found, render);
    if let Some(light) = &render.light {
        found.light("light", light);
    }
    if let Some(between) = &render.between {
        check_between(&mut found, render, between);
    }
    if !render.bones.is_empty() {
        let alone = !matches!(render.what, Some(What::Scene(_))) && !render.compare;
        found.unless(alone && render.between.is_none(), "bones", || {
            "not in scenes, not between two people, and nobody has filmed them to compare with"
                .into()
        });
    }
    match &render.what {
        Some(what) => check_pictures(&mut found, render, what),
        None => found.add("what", "views, an orbit, a motion or a scene is needed"),
    }
    found.0
}

fn check_pictures(found: &mut Faults, render: &RenderSpec, what: &What) {
    match what {
        What::Views(list) => {
            found.count("views.views", list.views.len());
            for (i, view) in list.views.iter().enumerate() {
                found.view(&format!("views.views[{i}]"), view);
            }
        }
        What::Orbit(orbit) => {
            found.count("orbit.views", orbit.views as usize);
            found.side("orbit.size", orbit.size);
        }
        What::Clip(clip) => {
            found.count("clip.poses", clip.poses.len());
            found.side("clip.size", clip.size);
            found.motion("clip", clip);
        }
        What::Motion(motion) => {
            // 0 means all remaining frames; the worker knows their number and limits it. With an end, this is
            // only an upper limit.
            if motion.frame_count > 0 && motion.end_frame.is_none() {
                found.count("motion.frame_count", motion.frame_count as usize);
            }
            found.end_frame("motion", motion.first_frame, motion.end_frame);
            found.unless(motion.frame_step > 0, "motion.frame_step", || {
                "a step of 0 never reaches the next frame".into()
            });
            found.side("motion.size", motion.size);
        }
        What::Scene(scene) => {
            found.unless(render.light.is_none(), "light", || {
                "the actors of a scene have their own".into()
            });
            found.unless(render.subject.is_empty(), "subject", || {
                "a scene has actors instead".into()
            });
            found.within_field("scene", scene::faults(scene));
            check_models(found, render, scene);
        }
    }
}

/// Number of pictures of one person in `what`, limited to [`MAX_PICTURES`]; 0 if it depends on a capture.
fn known_pictures(what: &What) -> u64 {
    let count = match what {
        What::Views(list) => list.views.len() as u64,
        What::Orbit(orbit) => orbit.views.into(),
        What::Clip(clip) => clip.poses.len() as u64,
        // With an end, the count is only an upper limit.
        What::Motion(motion) if motion.end_frame.is_none() => motion.frame_count.into(),
        What::Motion(_) | What::Scene(_) => 0,
    };
    count.min(MAX_PICTURES.into())
}

/// The fault of a render with too many pictures, `pictures` for each of `people`; `None` if the number is allowed.
pub fn too_many(pictures: u64, people: u64) -> Option<String> {
    let all = pictures.saturating_mul(people);
    (all > u64::from(MAX_PICTURES)).then(|| match people {
        1 => format!("{all} pictures: at most {MAX_PICTURES} are allowed"),
        _ => format!(
            "{pictures} pictures of {people} people are {all}: at most {MAX_PICTURES} are allowed"
        ),
    })
}

/// Checks the models of a scene: at least one actor must use the render's.
fn check_models(found: &mut Faults, render: &RenderSpec, scene: &Scene) {
    let mut models = scene.actors.iter().map(|actor| model_of(render, actor));
    let own = scene.actors.is_empty() || models.any(|model| model == render.model);
    found.unless(own, "scene.actors", || {
        format!(
            "nobody is of {}: render the scene with the model of an actor",
            render.model
        )
    });
    let measured = render.quality.as_ref().is_some_and(tiers::needs_tradeoff);
    let several = !other_models(render).is_empty();
    found.unless(!measured || !several, "quality", || {
        "people of several models have no trade-off that was measured together: leave the goal out, \
         and each model has its own settings"
            .into()
    });
}

fn check_between(found: &mut Faults, render: &RenderSpec, between: &Between) {
    let shares = between.shares.len();
    let (least, most) = (MIXTURES.start(), MIXTURES.end());
    found.unless(MIXTURES.contains(&shares), "between.shares", || {
        format!("{shares} mixtures: {least} to {most} are allowed")
    });
    for (i, share) in between.shares.iter().enumerate() {
        found.between(&format!("between.shares[{i}]"), *share, &(0.0..=1.0));
    }
    let pictures = render.what.as_ref().map_or(0, known_pictures);
    if let Some(message) = too_many(pictures, shares as u64) {
        found.add("between.shares", message);
    }
    let alone = !matches!(render.what, Some(What::Scene(_))) && !render.compare;
    found.unless(alone, "between", || {
        "not in scenes, and nobody has filmed them to compare with".into()
    });
}

fn check_background(found: &mut Faults, render: &RenderSpec) {
    let colour = &render.background;
    let in_unit = |value: &f32| (0.0..=1.0).contains(value);
    let good = matches!(colour.len(), 0 | 3) && colour.iter().all(in_unit);
    found.unless(good, "background", || {
        format!("{colour:?}: nothing, or three numbers from 0 to 1")
    });
    let black = colour.iter().all(|value| *value == 0.0);
    found.unless(!good || !render.transparent || black, "background", || {
        format!("{colour:?}: a transparent picture has none")
    });
}

/// Checks the ranges of the goal for each frame.
fn check_quality(found: &mut Faults, quality: &RenderQuality) {
    let mut above_zero = |name: &str, value: f64| {
        let field = format!("quality.{name}");
        found.unless(value.is_finite() && value > 0.0, &field, || {
            format!("{value} is not a number above 0")
        });
    };
    match &quality.want {
        Some(Want::MaxSecondsPerFrame(value)) => above_zero("max_seconds_per_frame", *value),
        Some(Want::MinPsnrDb(value)) => above_zero("min_psnr_db", *value),
        Some(Want::Tier(tier)) => {
            found.unless(tiers::is_render_tier(tier), "quality.tier", || {
                let shown: String = tier.chars().take(80).collect();
                let known = tiers::render_tiers();
                format!("there is no render quality '{shown}'; qualities: {known}")
            });
        }
        None => found.add("quality", "has no goal"),
    }
}

/// What the pictures show.
fn check_layer(found: &mut Faults, render: &RenderSpec) {
    let layer = Layer::try_from(render.layer);
    found.unless(layer.is_ok(), "layer", || {
        format!("{} is not known", render.layer)
    });
    let layered = !matches!(layer, Ok(Layer::Unspecified));
    let scene = match &render.what {
        Some(What::Scene(scene)) => Some(scene),
        _ => None,
    };
    let surrounded = scene.is_some_and(|scene| scene.shadow || !scene.backdrop.is_empty());
    let coloured = render.background.iter().any(|value| *value != 0.0);
    for (wrong, field, message) in [
        (
            layered && (render.transparent || surrounded || coloured),
            "layer",
            "depth and opacity have no background, transparency or shadow",
        ),
        (
            layered && render.compare,
            "compare",
            "only colours were filmed",
        ),
        (
            render.transparent && render.compare,
            "compare",
            "filmed pictures are not transparent",
        ),
        (
            render.transparent && scene.is_some_and(|scene| !scene.backdrop.is_empty()),
            "scene.backdrop",
            "a transparent picture has none",
        ),
    ] {
        found.unless(!wrong, field, || message.into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::actor::Motion;
    use crate::v1::{
        Actor, BodyPose, Camera, CaptureMotion, Light, MotionClip, MotionTransfer, Orbit, Scene,
        Skeleton, View, ViewList,
    };

    fn with(what: What) -> RenderSpec {
        RenderSpec {
            what: Some(what),
            ..RenderSpec::default()
        }
    }

    fn orbit(views: u32, size: u32) -> RenderSpec {
        with(What::Orbit(Orbit {
            frame: 0,
            views,
            size,
        }))
    }

    fn fields(spec: &RenderSpec) -> Vec<String> {
        faults(spec).into_iter().map(|it| it.field).collect()
    }

    fn view() -> View {
        View {
            pose: Some(BodyPose {
                rotations: vec![0.0; 72],
                translation: vec![0.0; 3],
            }),
            camera: Some(Camera {
                width: 64,
                height: 64,
                intrinsics: vec![1.0; 9],
                extrinsics: vec![0.0; 16],
            }),
        }
    }

    fn views(views: Vec<View>) -> RenderSpec {
        with(What::Views(ViewList { views }))
    }

    #[test]
    fn each_bad_number_is_named() {
        assert_eq!(faults(&orbit(12, 128)), []);
        assert_eq!(fields(&orbit(0, 7)), ["orbit.views", "orbit.size"]);
        assert_eq!(fields(&orbit(10_001, 4097)), ["orbit.views", "orbit.size"]);
        assert_eq!(fields(&views(Vec::new())), ["views.views"]);
        assert_eq!(fields(&RenderSpec::default()), ["what"]);
        type Change = fn(&mut RenderSpec);
        let cases: [(Change, &str); 6] = [
            (|it| it.background = vec![1.0, 0.5], "background"),
            (|it| it.background = vec![f32::NAN; 3], "background"),
            (
                |it| (it.transparent, it.background) = (true, vec![0.0, 1.0, 0.0]),
                "background",
            ),
            (|it| it.fps = -1.0, "fps"),
            (|it| it.layer = 99, "layer"),
            (|it| it.light = Some(Light { of: None }), "light"),
        ];
        for (change, field) in cases {
            let mut spec = orbit(12, 128);
            change(&mut spec);
            assert_eq!(fields(&spec), [field]);
        }
    }

    #[test]
    fn people_between_two_are_shares_of_them() {
        let with = |shares: &[f32], compare| RenderSpec {
            between: Some(Between {
                subject: "subjects/b".into(),
                shares: shares.to_vec(),
            }),
            compare,
            ..orbit(12, 128)
        };
        assert_eq!(faults(&with(&[0.0, 0.5, 1.0], false)), []);
        assert_eq!(fields(&with(&[], false)), ["between.shares"]);
        assert_eq!(fields(&with(&[0.5; 101], false)), ["between.shares"]);
        assert_eq!(fields(&with(&[0.5, 1.5], false)), ["between.shares[1]"]);
        assert_eq!(fields(&with(&[f32::NAN], false)), ["between.shares[0]"]);
        assert_eq!(fields(&with(&[0.5], true)), ["between"]);
        // Each person is in all pictures.
        let many = |views| RenderSpec {
            what: Some(What::Orbit(Orbit {
                frame: 0,
                views,
                size: 16,
            })),
            ..with(&[0.5; 100], false)
        };
        assert_eq!(faults(&many(100)), []);
        let found = faults(&many(10_000));
        assert_eq!(found[0].field, "between.shares");
        let message = &found[0].message;
        assert!(message.contains("1000000: at most 10000"), "{message}");
    }

    #[test]
    fn a_fault_names_its_view_and_field() {
        assert_eq!(faults(&views(vec![view()])), []);
        let broken = |change: fn(&mut View)| {
            let mut broken = view();
            change(&mut broken);
            faults(&views(vec![view(), broken]))
        };
        let found = broken(|it| it.camera.as_mut().expect("has one").intrinsics.truncate(8));
        assert_eq!(found[0].field, "views.views[1].camera.intrinsics");
        assert_eq!(found[0].message, "8 numbers, not 9");
        let found = broken(|it| it.pose.as_mut().expect("has one").rotations[1] = f32::NAN);
        assert_eq!(found[0].field, "views.views[1].pose.rotations[1]");
        let found = broken(|it| it.camera = None);
        assert_eq!(found[0].field, "views.views[1]");
    }

    #[test]
    fn a_motion_reaches_its_end() {
        let motion = |frame_count, frame_step, size| {
            with(What::Motion(MotionTransfer {
                frame_count,
                frame_step,
                size,
                ..MotionTransfer::default()
            }))
        };
        assert_eq!(faults(&motion(2, 1, 64)), []);
        assert_eq!(faults(&motion(0, 1, 64)), []);
        assert_eq!(fields(&motion(2, 0, 64)), ["motion.frame_step"]);
        assert_eq!(fields(&motion(10_001, 1, 64)), ["motion.frame_count"]);
        assert_eq!(fields(&motion(2, 1, scene::MAX_SIDE + 1)), ["motion.size"]);
        let until = |end_frame| {
            with(What::Motion(MotionTransfer {
                first_frame: Some(60),
                end_frame: Some(end_frame),
                frame_step: 1,
                size: 64,
                ..MotionTransfer::default()
            }))
        };
        assert_eq!(faults(&until(61)), []);
        let mut wide = until(36_000);
        if let Some(What::Motion(motion)) = &mut wide.what {
            motion.frame_count = 35_940;
        }
        assert_eq!(faults(&wide), []);
        assert_eq!(fields(&until(60)), ["motion.end_frame"]);
    }

    #[test]
    fn a_quality_is_one_that_can_be_wanted() {
        let said = |want: Option<Want>| {
            let mut spec = orbit(12, 128);
            spec.quality = Some(RenderQuality { want });
            let found = faults(&spec);
            assert!(found.len() < 2, "{found:?}");
            found.into_iter().next()
        };
        assert_eq!(said(Some(Want::MaxSecondsPerFrame(0.1))), None);
        assert_eq!(said(Some(Want::MinPsnrDb(30.0))), None);
        assert_eq!(said(Some(Want::Tier("fast".into()))), None);
        for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            let fault = said(Some(Want::MaxSecondsPerFrame(bad))).expect("refused");
            assert_eq!(fault.field, "quality.max_seconds_per_frame");
            let fault = said(Some(Want::MinPsnrDb(bad))).expect("refused");
            assert_eq!(fault.field, "quality.min_psnr_db");
        }
        let fault = said(Some(Want::Tier("paper".into()))).expect("a training tier");
        assert_eq!(fault.field, "quality.tier");
        let known = "full, balanced, fast, draft";
        assert!(fault.message.contains(known), "{fault:?}");
        assert_eq!(said(None).expect("nothing wanted").field, "quality");
    }

    #[test]
    fn a_clip_s_skeleton_and_poses_fit() {
        let good = || MotionClip {
            skeleton: Some(Skeleton {
                names: vec!["root".into(), "tip".into()],
                parents: vec![-1, 0],
                rest_joints: Vec::new(),
            }),
            poses: vec![BodyPose {
                rotations: vec![0.0; 6],
                translation: vec![0.0; 3],
            }],
            size: 64,
            ..MotionClip::default()
        };
        assert_eq!(faults(&with(What::Clip(good()))), []);
        type Change = fn(&mut MotionClip);
        let cases: [(Change, &str); 6] = [
            (|it| it.size = 0, "clip.size"),
            (|it| it.poses.clear(), "clip.poses"),
            (|it| it.skeleton = None, "clip.skeleton.parents"),
            (
                |it| it.poses[0].rotations.truncate(3),
                "clip.poses[0].rotations",
            ),
            (
                |it| it.poses[0].rotations[1] = f32::NAN,
                "clip.poses[0].rotations[1]",
            ),
            (
                |it| it.skeleton.as_mut().expect("has one").parents = vec![1, 0],
                "clip.skeleton.parents[0]",
            ),
        ];
        for (change, field) in cases {
            let mut clip = good();
            change(&mut clip);
            assert_eq!(fields(&with(What::Clip(clip))), [field]);
        }
    }

    /// A scene by the model duo with an actor of each of `models`.
    fn scene_of(models: &[&str]) -> RenderSpec {
        let actor = |model: &&str| Actor {
            motion: Some(Motion::Capture(CaptureMotion::default())),
            model: (*model).into(),
            ..Actor::default()
        };
        let scene = Scene {
            actors: models.iter().map(actor).collect(),
            width: 64,
            height: 64,
            ..Scene::default()
        };
        RenderSpec {
            model: "models/duo".into(),
            ..with(What::Scene(scene))
        }
    }

    #[test]
    fn people_of_several_models_have_their_models_own_settings() {
        assert_eq!(faults(&scene_of(&["", "models/fog"])), []);
        assert_eq!(faults(&scene_of(&["models/fog", "models/duo"])), []);
        assert_eq!(fields(&scene_of(&["models/fog"])), ["scene.actors"]);
        let names = fields(&scene_of(&["", "fog"]));
        assert_eq!(names, ["scene.actors[1].model"]);
        let goal = |models: &[&str], tier: &str| {
            let want = Some(Want::Tier(tier.into()));
            fields(&RenderSpec {
                quality: Some(RenderQuality { want }),
                ..scene_of(models)
            })
        };
        assert_eq!(goal(&["", "models/fog"], "fast"), ["quality"]);
        assert_eq!(goal(&["", "models/fog"], "realtime"), [""; 0]);
        assert_eq!(goal(&["", "models/duo"], "fast"), [""; 0]);
    }

    #[test]
    fn a_scene_has_actors_instead_of_a_subject() {
        let mut spec = scene_of(&[""]);
        assert_eq!(faults(&spec), []);
        spec.subject = "subjects/a".into();
        assert_eq!(fields(&spec), ["subject"]);
        spec.subject.clear();
        if let Some(What::Scene(scene)) = &mut spec.what {
            scene.actors[0].speed = 1e9;
        }
        assert_eq!(fields(&spec), ["scene.actors[0].speed"]);
    }
}
