//! Pictures of several people of splats: mixtures, other bones, one in front of the other, and light.

use super::splats::{SIZE, trainer, view_of};
use crate::support::{people, run};
use yoto_avatar::render::{Actor, Light, Rendered, Renderer, SceneView};
use yoto_avatar::train::TrainPerson;
use yoto_capture::camera::{Camera, Pose};

/// Splats of two people do not correspond: a mixture of them is both, on the same bones, with the colours in between.
#[test]
fn a_mixture_of_two_people_of_splats_is_both() {
    let trainer = trainer(&[0, 1], 6);
    let renderer = || trainer.renderer();
    let people = people(&[0, 1], 12, SIZE);
    let picture = |renderer: &Renderer, slots: &[usize]| {
        let mut view = SceneView::from(view_of(&people[0], 0, 0));
        let actor = view.actors.remove(0);
        let actors = slots.iter().map(|slot| Actor {
            model: 0,
            slot: *slot,
            ..actor.clone()
        });
        view.actors.extend(actors);
        rendered(renderer, &view)
    };
    let (none, slots) = renderer().with_blend(0, 1, 0.0).expect("blends");
    assert_eq!(slots.len(), 1);
    let own = picture(&none, &[0]);
    assert_eq!(
        picture(&none, &slots).rgb,
        own.rgb,
        "a share of 0 is the first one"
    );
    let (half, slots) = renderer().with_blend(0, 1, 0.5).expect("blends");
    assert_eq!(slots.len(), 2);
    let both = picture(&half, &slots);
    let alone = picture(&half, &slots[..1]);
    let sum = |alpha: &[f32]| alpha.iter().sum::<f32>();
    assert!(
        sum(&alone.alpha) < 0.95 * sum(&both.alpha),
        "each is half as opaque"
    );
    assert!(both.rgb != own.rgb);
    // The mean colour of a person, over black.
    let colour = |picture: &Rendered| -> [f32; 3] {
        let pixels = picture.rgb.as_chunks::<3>().0;
        std::array::from_fn(|c| pixels.iter().map(|it| it[c]).sum::<f32>() / sum(&picture.alpha))
    };
    let off = |a: [f32; 3], b: [f32; 3]| {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f32>()
            .sqrt()
    };
    let (all, slots) = renderer().with_blend(0, 1, 1.0).expect("blends");
    let (first, second) = (colour(&own), colour(&picture(&all, &slots)));
    let (apart, here) = (off(first, second), off(colour(&alone), second));
    assert!(apart > 0.02, "two people in other clothes: {apart}");
    assert!(
        here < 0.8 * apart,
        "{here} of {apart}: the first alone looks as both do"
    );
    assert!(renderer().with_blend(0, 1, 1.5).is_err());
    assert!(renderer().with_blend(0, 2, 0.5).is_err());
}

#[test]
fn a_person_on_shorter_bones_is_shorter() {
    let trainer = trainer(&[0, 1], 6);
    let renderer = trainer.renderer();
    let person = &people(&[0], 12, SIZE)[0];
    let own = renderer.skeleton(0).expect("a skeleton").clone();
    let mut shorter = own.clone();
    for value in shorter.rest.iter_mut().flatten() {
        *value *= 0.75;
    }
    let (renderer, same) = renderer.with_bones(0, &own).expect("fits");
    let (renderer, short) = renderer.with_bones(0, &shorter).expect("fits");
    let at = |slot| renderer.render(&view_of(person, slot, 0)).expect("renders");
    assert_eq!(
        at(same).rgb,
        at(0).rgb,
        "on their own bones nothing changes"
    );
    let rows = |slot| {
        let alpha = at(slot).alpha;
        let rows = alpha.chunks_exact(SIZE as usize);
        rows.filter(|row| row.iter().any(|a| *a > 0.5)).count() as f64
    };
    // What is around the bones, as the head, is as large as before.
    let ratio = rows(short) / rows(0);
    assert!((0.7..0.9).contains(&ratio), "{ratio}");

    let mut fewer = own;
    fewer.rest.pop();
    fewer.parents.pop();
    fewer.names.pop();
    let error = renderer.with_bones(0, &fewer).err().expect("refused");
    let error = error.to_string();
    assert!(error.contains("23 joints, the person has 24"), "{error}");
}

/// Frame 0 of each of `people` in one picture, the second `metres` nearer to the camera.
fn scene(people: &[TrainPerson], metres: f32) -> SceneView {
    let track = &people[0].shard.track;
    let camera = Camera::from_frame(&track.frames[0], track.image_size).expect("a camera");
    let actors = people.iter().zip([0.0, metres]).map(|(person, nearer)| {
        let mut pose = Pose::from_frame(&person.shard.track.frames[0]).expect("a pose");
        for (axis, along) in pose.translation.iter_mut().zip(camera.e[2]) {
            *axis -= nearer * along as f32;
        }
        Actor {
            model: 0,
            slot: person.slot,
            pose,
            light: Light::Own,
        }
    });
    SceneView {
        actors: actors.collect(),
        background: [0.0; 3],
        camera,
    }
}

fn rendered(renderer: &Renderer, view: &SceneView) -> Rendered {
    renderer.render_scene(view, &mut |_| true).expect("renders")
}

#[test]
fn a_splat_person_in_front_hides_the_other() {
    let people = people(&[0, 1], 12, SIZE);
    let renderer = trainer(&[0, 1], 1).renderer();
    let scene = scene(&people, 1.0);
    let both = rendered(&renderer, &scene);
    let alone = |place: usize| {
        let mut one = scene.clone();
        one.actors = vec![scene.actors[place].clone()];
        rendered(&renderer, &one)
    };
    let (back, front) = (alone(0), alone(1));
    let mut hidden = 0;
    for i in 0..both.alpha.len() {
        let through = 1.0 - front.alpha[i];
        for c in 0..3 {
            let rgb = front.rgb[3 * i + c] + through * back.rgb[3 * i + c];
            assert!((both.rgb[3 * i + c] - rgb).abs() < 2e-3);
        }
        hidden += usize::from(front.alpha[i] > 0.9 && back.alpha[i] > 0.9);
    }
    assert!(
        hidden > 50,
        "{hidden} pixels of the person behind are hidden"
    );
    let mut other = scene.clone();
    other.actors.reverse();
    assert_eq!(rendered(&renderer, &other).alpha.len(), both.alpha.len());
    let apart = rendered(&renderer, &other).rgb;
    let apart = apart.iter().zip(&both.rgb).map(|(a, b)| (a - b).abs());
    assert!(
        apart.fold(0.0, f32::max) < 1e-6,
        "their order does not matter"
    );
}

#[test]
fn light_is_the_capture_s_none_or_another_person_s() {
    let people = people(&[0, 1], 12, SIZE);
    let mut trainer = trainer(&[0, 1], 60);
    run(&mut trainer, 60);
    let renderer = trainer.renderer();
    let of = |slot: usize, light: Light| {
        let mut view = scene(&people, 0.0);
        view.actors = vec![view.actors[slot].clone()];
        view.actors[0].light = light;
        rendered(&renderer, &view)
    };
    let same = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let rotation = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    let own = of(0, Light::Own);
    let named = of(
        0,
        Light::Of {
            slot: 0,
            rotation: same,
        },
    );
    assert_eq!(own.rgb, named.rgb);
    let others = [
        Light::Neutral,
        Light::Of {
            slot: 1,
            rotation: same,
        },
        Light::Of { slot: 0, rotation },
    ];
    for light in others {
        let lit = of(0, light);
        assert_eq!(own.alpha, lit.alpha, "light moves nothing: {light:?}");
        let apart = own.rgb.iter().zip(&lit.rgb).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f32::max) > 1e-3, "{light:?}");
    }
    let nobody = Light::Of {
        slot: 7,
        rotation: same,
    };
    let mut view = scene(&people, 0.0);
    view.actors[0].light = nobody;
    assert!(renderer.render_scene(&view, &mut |_| true).is_err());
}
