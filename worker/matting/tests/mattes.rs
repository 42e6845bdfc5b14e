//! Tiny networks in real files.

mod networks;

use networks::{Network, bright};
use std::path::{Path, PathBuf};
use yoto_matting::{Levels, Matte, Matter, MattingError, ModelForm};

/// Opens `network` as a file.
fn open(network: Network, levels: Levels) -> Result<Matter, MattingError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("network.onnx");
    network.write(&path);
    Matter::open(&path, levels)
}

/// Takes levels from 0 to 1 in RVM's form. Its first picture is blank: the matte is the brightest
/// channel as far as the memory says that there was a picture before.
fn recurrent() -> Network {
    let mut network = Network::default()
        .input("src", &[1, 3, 0, 0])
        .constant("one", 1.0)
        .constant("steep", 6.0)
        .node("ReduceMax", &["src"], "brightest")
        .with("axes", &[1])
        .node("Mul", &["brightest", "steep"], "steeper")
        .node("Min", &["r1i", "one"], "known")
        .node("Mul", &["steeper", "known"], "levels")
        .node("Min", &["levels", "one"], "pha")
        .node("Mul", &["src", "downsample_ratio"], "fgr")
        .output("fgr", &[1, 3, 0, 0])
        .output("pha", &[1, 1, 0, 0]);
    for at in 1..=4 {
        let (before, after) = (format!("r{at}i"), format!("r{at}o"));
        network = network
            .input(&before, &[0, 0, 0, 0])
            .node("Add", &[&before, "one"], &after)
            .output(&after, &[0, 0, 0, 0]);
    }
    network.input("downsample_ratio", &[1])
}

const SIZE: [usize; 2] = [96, 64];

/// A black picture with white rectangles (left, top, width, height).
fn picture(rectangles: &[[usize; 4]]) -> Vec<u8> {
    let mut rgb = vec![0; SIZE[0] * SIZE[1] * 3];
    for &[left, top, width, height] in rectangles {
        for row in top..top + height {
            let start = 3 * (row * SIZE[0] + left);
            rgb[start..start + 3 * width].fill(255);
        }
    }
    rgb
}

fn at(matte: &Matte, column: usize, row: usize) -> u8 {
    matte.coverage[row * SIZE[0] + column]
}

/// Two people: one of 20 × 40 and a smaller one of 12 × 24.
const TWO: [[usize; 4]; 2] = [[10, 10, 20, 40], [60, 20, 12, 24]];

#[test]
fn the_largest_person_is_taken_or_the_expected_one() {
    let mut matter = open(bright(0, 0), Levels::Signed).expect("a model");
    assert_eq!(matter.form(), ModelForm::Single);
    let matte = matter.look(&picture(&TWO), SIZE, None).expect("a matte");
    assert_eq!(
        [at(&matte, 20, 30), at(&matte, 66, 30), at(&matte, 45, 5)],
        [255, 0, 0]
    );
    let mut expected = vec![0; SIZE[0] * SIZE[1]];
    for row in 22..40 {
        expected[row * SIZE[0] + 58..row * SIZE[0] + 70].fill(255);
    }
    let matte = matter
        .look(&picture(&TWO), SIZE, Some(&expected))
        .expect("a matte");
    assert_eq!([at(&matte, 20, 30), at(&matte, 66, 30)], [0, 255]);
    let empty = matter.look(&picture(&[]), SIZE, None).expect("a matte");
    assert!(!empty.is_somebody && empty.coverage.iter().all(|it| *it == 0));
}

#[test]
fn a_network_of_one_size_sees_the_picture_at_that_size() {
    let mut matter = open(bright(32, 32), Levels::Signed).expect("a model");
    let matte = matter.look(&picture(&TWO), SIZE, None).expect("a matte");
    let drawn = |column: usize, row: usize| (10..30).contains(&column) && (10..50).contains(&row);
    let agree = (0..SIZE[0] * SIZE[1])
        .filter(|pixel| {
            let (column, row) = (pixel % SIZE[0], pixel / SIZE[0]);
            (at(&matte, column, row) > 127) == drawn(column, row)
        })
        .count();
    let share = agree as f64 / (SIZE[0] * SIZE[1]) as f64;
    assert!(share > 0.97, "{share} of the pixels agree");
}

#[test]
fn other_levels_are_another_matte() {
    // Black is 0 in levels from 0 to 1, which this network takes for grey.
    let mut matter = open(bright(0, 0), Levels::Unit).expect("a model");
    let matte = matter.look(&picture(&TWO), SIZE, None).expect("a matte");
    assert_eq!(at(&matte, 45, 5), 255);
    matter.set_levels(Levels::Signed);
    let matte = matter.look(&picture(&TWO), SIZE, None).expect("a matte");
    assert_eq!(at(&matte, 45, 5), 0);
}

#[test]
fn a_recurrent_network_is_given_what_it_has_seen() {
    let mut matter = open(recurrent(), Levels::Unit).expect("a model");
    assert_eq!(matter.form(), ModelForm::Recurrent);
    let first = matter.look(&picture(&TWO), SIZE, None).expect("a matte");
    assert!(!first.is_somebody, "it has seen nothing before");
    let second = matter.look(&picture(&TWO), SIZE, None).expect("a matte");
    assert_eq!([at(&second, 20, 30), at(&second, 45, 5)], [255, 0]);
    matter.set_levels(Levels::Unit);
    let again = matter.look(&picture(&TWO), SIZE, None).expect("a matte");
    assert!(!again.is_somebody, "it has forgotten");
}

#[test]
fn files_that_are_no_matting_models_are_named_with_what_is_wrong() {
    let error = |result: Result<Matter, MattingError>| result.expect_err("refused").to_string();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        path
    };
    let open_at = |path: &Path| error(Matter::open(path, Levels::Unit));
    let text = open_at(&folder.path().join("none.onnx"));
    assert!(
        text.contains("none.onnx") && text.contains("No such file"),
        "{text}"
    );
    assert!(open_at(folder.path()).contains("is not a file"));
    for (name, bytes) in [
        ("text.onnx", &b"hello, this is no network"[..]),
        ("picture.png", b"\x89PNG\r\n\x1a\n"),
    ] {
        let text = open_at(&write(name, bytes));
        assert!(
            text.contains(name) && text.contains("not an ONNX file"),
            "{text}"
        );
    }
    let text = open_at(&write("empty.onnx", b""));
    assert!(text.contains("empty.onnx: has no inputs"), "{text}");
    let cut = bright(0, 0).bytes();
    let text = open_at(&write("cut.onnx", &cut[..cut.len() / 2]));
    assert!(text.contains("cut.onnx"), "{text}");
    let unknown = Network::default()
        .input("input", &[1, 3, 0, 0])
        .node("Dream", &["input"], "output")
        .output("output", &[1, 1, 0, 0]);
    let text = error(open(unknown, Levels::Unit));
    assert!(text.contains("Dream"), "{text}");
    let grey = Network::default()
        .input("grey", &[1, 1, 64, 64])
        .node("Identity", &["grey"], "output")
        .output("output", &[1, 1, 64, 64]);
    let text = error(open(grey, Levels::Unit));
    assert!(
        text.contains("grey") && text.contains("[1, 1, 64, 64]"),
        "{text}"
    );
    let two = Network::default()
        .input("image", &[1, 3, 0, 0])
        .input("trimap", &[1, 1, 0, 0])
        .node("Add", &["image", "trimap"], "output")
        .output("output", &[1, 3, 0, 0]);
    let text = error(open(two, Levels::Unit));
    assert!(text.contains("image, trimap"), "{text}");
}

#[test]
fn what_is_no_matte_is_an_error_with_the_outputs_name() {
    let look = |network: Network| {
        let mut matter = open(network, Levels::Unit).expect("a model");
        let looked = matter.look(&picture(&TWO), SIZE, None);
        looked.expect_err("no matte").to_string()
    };
    let colours = Network::default()
        .input("input", &[1, 3, 0, 0])
        .node("Neg", &["input"], "colours")
        .output("colours", &[1, 3, 0, 0]);
    let text = look(colours);
    assert!(
        text.contains("colours") && text.contains("[1, 3, 64, 96]"),
        "{text}"
    );
    let holes = Network::default()
        .input("input", &[1, 3, 0, 0])
        .node("ReduceMax", &["input"], "brightest")
        .with("axes", &[1])
        .node("Div", &["brightest", "brightest"], "holes")
        .output("holes", &[1, 1, 0, 0]);
    let text = look(holes);
    assert!(text.contains("holes is NaN at column 0, row 0"), "{text}");
    let mut matter = open(bright(0, 0), Levels::Signed).expect("a model");
    assert!(matter.look(&[0; 3], SIZE, None).is_err());
    assert!(matter.look(&picture(&TWO), SIZE, Some(&[0; 3])).is_err());
    assert!(matter.look(&[], [0, 0], None).is_err());
}

/// Damaged files are refused, or run with any result, but never end the process.
#[test]
fn damaged_files_do_not_end_the_process() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("damaged.onnx");
    let whole = bright(32, 32).bytes();
    let mut opened = 0;
    for at in 0..whole.len() {
        for value in [1, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            std::fs::write(&path, &bytes).expect("a file");
            if let Ok(mut matter) = Matter::open(&path, Levels::Signed) {
                opened += 1;
                let _ = matter.look(&picture(&TWO), SIZE, None);
            }
        }
    }
    assert!((1..2 * whole.len()).contains(&opened), "{opened}");
}
