//! A person of a field and one of splats, of two models, in one picture.

use crate::support::{options, people, run};
use burn::tensor::Device;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::render::{
    Actor, Light, ModelActor, RenderError, Rendered, Renderer, SceneView, render_together,
};
use yoto_avatar::train::{TrainPerson, Trainer};
use yoto_capture::camera::{Camera, Pose};

const SIZE: u32 = 64;

/// A model of `tier` after some steps with one person.
fn trained(tier: &str, person: TrainPerson, steps: u64) -> Renderer {
    let mut config = ModelConfig::named(tier, "yoto").expect("a tier");
    config.refinement.who = Refine::Never;
    if let Some(splats) = config.appearance.splats_mut() {
        splats.count = 2000;
    }
    let device = Device::flex();
    let mut trainer = Trainer::new(config, options(steps), vec![person], &device).expect("starts");
    run(&mut trainer, steps as usize);
    trainer.renderer()
}

/// The person of frame 0, `metres` nearer to the camera than they were filmed.
fn nearer(person: &TrainPerson, camera: &Camera, metres: f32) -> Actor {
    let mut pose = Pose::from_frame(&person.shard.track.frames[0]).expect("a pose");
    for (axis, along) in pose.translation.iter_mut().zip(camera.e[2]) {
        *axis -= metres * along as f32;
    }
    Actor {
        model: 0,
        slot: 0,
        pose,
        light: Light::Own,
    }
}

fn together(people: &[(&Renderer, &Actor)], camera: &Camera) -> Rendered {
    let people: Vec<ModelActor<'_>> = (people.iter())
        .map(|(model, actor)| ModelActor { model, actor })
        .collect();
    render_together(&people, camera, [0.0; 3], &mut |_| true).expect("renders")
}

fn largest_difference(one: &[f32], other: &[f32]) -> f32 {
    let apart = one.iter().zip(other).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f32::max)
}

#[test]
fn a_field_and_splats_hide_each_other() {
    let person = || people(&[0], 12, SIZE).remove(0);
    let (ada, field, splats) = (
        person(),
        trained("draft", person(), 120),
        trained("splat", person(), 40),
    );
    let track = &ada.shard.track;
    let camera = Camera::from_frame(&track.frames[0], track.image_size).expect("a camera");
    let (back, front) = (nearer(&ada, &camera, 0.0), nearer(&ada, &camera, 1.0));
    let alone = |model: &Renderer, actor: &Actor| {
        let view = SceneView {
            actors: vec![actor.clone()],
            camera: camera.clone(),
            background: [0.0; 3],
        };
        model.render_scene(&view, &mut |_| true).expect("renders")
    };
    // Alone, each is as in a picture of their own model.
    for model in [&field, &splats] {
        let (own, here) = (alone(model, &back), together(&[(model, &back)], &camera));
        assert!(largest_difference(&own.rgb, &here.rgb) < 2e-3);
        assert!(largest_difference(&own.alpha, &here.alpha) < 2e-3);
        assert!(largest_difference(&own.depth, &here.depth) < 1e-2);
    }
    for (near, far) in [(&field, &splats), (&splats, &field)] {
        let both = together(&[(near, &front), (far, &back)], &camera);
        let other = together(&[(far, &back), (near, &front)], &camera);
        assert!(
            largest_difference(&both.rgb, &other.rgb) < 1e-6,
            "their order does not matter"
        );
        let (front, back) = (alone(near, &front), alone(far, &back));
        let mut hidden = 0;
        for i in 0..both.alpha.len() {
            let through = 1.0 - front.alpha[i];
            for c in 0..3 {
                let rgb = front.rgb[3 * i + c] + through * back.rgb[3 * i + c];
                assert!((both.rgb[3 * i + c] - rgb).abs() < 4e-3);
            }
            hidden += usize::from(front.alpha[i] > 0.8 && back.alpha[i] > 0.8);
        }
        assert!(
            hidden > 50,
            "{hidden} pixels of whoever is behind are hidden"
        );
    }
    // In the same place, neither is in front as a whole.
    let both = together(&[(&field, &back), (&splats, &back)], &camera);
    let (one, other) = (alone(&field, &back), alone(&splats, &back));
    let over = |a: &Rendered, b: &Rendered, i: usize| a.rgb[i] + (1.0 - a.alpha[i / 3]) * b.rgb[i];
    let merged = (0..both.rgb.len()).filter(|i| {
        let [a, b] = [over(&one, &other, *i), over(&other, &one, *i)];
        both.rgb[*i] > a.min(b) + 1e-3 && both.rgb[*i] < a.max(b) - 1e-3
    });
    assert!(merged.count() > 20);

    // Splats of two models are drawn as those of one.
    let view = SceneView {
        actors: vec![back.clone(), front.clone()],
        camera: camera.clone(),
        background: [0.0; 3],
    };
    let one = splats.render_scene(&view, &mut |_| true).expect("renders");
    let two = together(&[(&splats, &back), (&splats, &front)], &camera);
    assert_eq!((one.rgb, one.alpha), (two.rgb, two.alpha));
    assert_eq!(one.depth, two.depth);

    let stopped = render_together(
        &[ModelActor {
            model: &field,
            actor: &back,
        }],
        &camera,
        [0.0; 3],
        &mut |_| false,
    );
    assert!(matches!(stopped, Err(RenderError::Stopped)));
    let lit = Actor {
        light: Light::Neutral,
        ..back
    };
    let refused = render_together(
        &[ModelActor {
            model: &field,
            actor: &lit,
        }],
        &camera,
        [0.0; 3],
        &mut |_| true,
    );
    assert!(matches!(refused, Err(RenderError::NoLight)));
}
