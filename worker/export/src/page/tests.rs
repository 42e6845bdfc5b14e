use super::*;
use crate::gaussians::posed;
use yoto_avatar::render::{SkinnedShapes, SkinnedSplat};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{IDENTITY, inverse};

fn person() -> SkinnedSplats {
    let splat = |x: f32, bone: u16| SkinnedSplat {
        mean: [x, 1.0, 0.25],
        rotation: [1.0, 0.0, 0.0, 0.0],
        deviations: [0.01, 0.02, 0.005],
        opacity: 0.75,
        colour: [0.25, 0.5, 1.5],
        harmonics: std::array::from_fn(|k| match k {
            2 => [0.5, -1.0, x],
            _ => [0.0; 3],
        }),
        bones: [(bone, 0.75), (0, 0.25), (0, 0.0), (0, 0.0)],
        guessed: bone == 1,
    };
    SkinnedSplats {
        skeleton: Skeleton {
            names: vec!["root".into(), "l_elbow</script>".into()],
            parents: vec![None, Some(0)],
            rest: vec![[0.0, 1.0, 0.0], [0.5, 1.0, 0.0]],
        },
        splats: vec![splat(0.0, 0), splat(1.0, 1)],
        degree: 1,
        shapes: Some(SkinnedShapes {
            count: 1,
            reach: 0.12,
            // A turn of the elbow about z moves what is near along y, by R₀₀ − 1.
            basis: (0..54)
                .map(|i| f32::from(u8::from(i == 28)) * -0.2)
                .collect(),
            limits: [vec![-2.0; 18], vec![2.0; 18]].concat(),
            weights: vec![0.5, -1.0],
        }),
        light: [[0.0; 8]; 3],
    }
}

#[test]
fn a_page_is_whole_and_nothing_in_it_ends_its_scripts() {
    let person = person();
    let clip = Clip {
        name: "<b>{{player}}".into(),
        ..Clip::rest(&person.skeleton)
    };
    let page = page("Ada <i> {{person}}", &person, &[clip]).expect("a page");
    assert!(page.contains("<title>Ada &lt;i&gt; &#123;&#123;person}}</title>"));
    // The person and the player.
    assert_eq!(page.matches("</script>").count(), 2);
    for outside in ["http:", "https:", "src=", "href="] {
        assert!(!page.contains(outside), "{outside}");
    }
    let (before, _) = page.split_once("<script").expect("a script");
    assert!(
        before.contains("Content-Security-Policy\" content=\"default-src 'none';"),
        "{before}"
    );
    let data = page.split(r#"id="person">"#).nth(1).expect("data");
    let data = data.split("</script>").next().expect("data");
    let data: serde_json::Value = serde_json::from_str(data).expect("json");
    assert_eq!(data["count"], 2);
    assert_eq!(data["parents"], serde_json::json!([null, 0]));
    assert_eq!(data["clips"][0]["name"], "<b>{{player}}");
    let bytes = STANDARD
        .decode(data["splats"].as_str().expect("text"))
        .expect("base64");
    assert_eq!(bytes.len(), 2 * 36);
    let number = |splat: usize, field: usize| {
        let at = 36 * splat + 2 * field;
        f32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])) / 65535.0
    };
    assert_eq!([number(0, 0), number(1, 0)], [0.0, 1.0], "x in the box");
    assert!((number(0, 10) - 0.75).abs() < 1e-4, "opacity");
    assert!((-1.0 + 4.0 * number(1, 13) - 1.5).abs() < 1e-4, "blue");
    assert_eq!(bytes[36 + 28..36 + 36], [1, 0, 0, 0, 191, 64, 0, 0]);
    let shine = STANDARD.decode(data["harmonics"].as_str().expect("text"));
    let shine = shine.expect("base64");
    assert_eq!(shine.len(), 2 * 9);
    assert_eq!(shine[..9], [128, 128, 128, 128, 128, 128, 192, 1, 128]);
    assert_eq!(shine[15..], [192, 1, 255]);
    let guessed = STANDARD.decode(data["guessed"].as_str().expect("text"));
    assert_eq!(guessed.expect("base64"), [0b10], "the second splat");
    let shapes = &data["shapes"];
    let bytes = |name: &str| STANDARD.decode(shapes[name].as_str().expect("text"));
    assert_eq!(
        (&shapes["count"], &shapes["most"]),
        (&1.into(), &1.0.into())
    );
    assert_eq!(
        bytes("weights").expect("base64"),
        [192, 1],
        "a half and −1, of 127"
    );
    let basis = bytes("basis").expect("base64");
    assert_eq!(basis.len(), 2 * 9 * 3 * 4);
    assert_eq!(basis[4 * 28..4 * 29], (-0.2f32).to_le_bytes());
    assert_eq!(bytes("limits").expect("base64").len(), 2 * 9 * 2 * 4);
    let poses = STANDARD.decode(data["clips"][0]["poses"].as_str().expect("text"));
    assert_eq!(poses.expect("base64").len(), 12 + 2 * 8);
}

#[test]
fn poses_of_another_skeleton_are_refused() {
    let person = person();
    let clip = Clip {
        poses: vec![Pose::rest(3)],
        ..Clip::rest(&person.skeleton)
    };
    assert!(page("Ada", &person, &[clip]).is_err());
    assert!(posed(&person, &Pose::rest(3), &IDENTITY).is_err());
}

#[test]
fn bones_carry_gaussians() {
    let mut person = person();
    person.splats[1].bones = [(1, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
    let mut pose = Pose::rest(2);
    pose.translation = [0.0, 0.0, 2.0];
    // The elbow, a quarter turn about z: what was half a metre beyond it on x is above it.
    pose.rotations[1] = [0.0, 0.0, std::f32::consts::FRAC_PI_2];
    let carried = posed(&person, &pose, &IDENTITY).expect("a pose")[1];
    for (found, expected) in carried.mean.iter().zip([0.5, 1.5, 2.25]) {
        assert!((found - expected).abs() < 1e-5, "{:?}", carried.mean);
    }
    let mut widths = carried.deviations;
    widths.sort_by(f32::total_cmp);
    for (found, expected) in widths.iter().zip([0.005, 0.01, 0.02]) {
        assert!((found - expected).abs() < 1e-6, "{widths:?}");
    }
    assert_eq!(carried.colour, [0.25, 0.5, 1.0], "what a screen can show");
    // Back where the body stands at rest.
    let back = inverse(&person.skeleton.body_to_world(&pose));
    let back = posed(&person, &pose, &back).expect("a pose")[1];
    assert!((back.mean[2] - 0.25).abs() < 1e-5, "{:?}", back.mean);
}

#[test]
fn pose_blend_shapes_move_gaussians_before_bones_carry_them() {
    let mut person = person();
    // 5 cm below the elbow, which carries it.
    person.splats[1].mean = [0.5, 0.95, 0.0];
    person.splats[1].bones = [(1, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
    let mut pose = Pose::rest(2);
    pose.rotations[1] = [0.0, 0.0, std::f32::consts::FRAC_PI_2];
    let mean = |person: &SkinnedSplats| posed(person, &pose, &IDENTITY).expect("a pose")[1].mean;
    let moved = mean(&person);
    person.shapes = None;
    let carried = mean(&person);
    // The turn's R₀₀ − 1 is −1: 0.2 m along y, by the weight −1 and the nearness; the bone turns y to −x.
    let near = (-0.05f32.powi(2) / (2.0 * 0.12f32.powi(2))).exp();
    let expected = [0.2 * near, 0.0, 0.0];
    for ((moved, carried), expected) in moved.iter().zip(carried).zip(expected) {
        let off = moved - carried - expected;
        assert!(off.abs() < 1e-5, "{moved} {carried} {expected}");
    }
}
