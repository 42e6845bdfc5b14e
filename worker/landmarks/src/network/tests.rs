//! Small networks that are read from files and run.

use super::Network;
use crate::tflite::writer::{Does, Node, Values, computed, floats, ints, model};

/// The output of the one operator `does` for `input`.
fn run(tensors: &[Values], does: Does, input: &[f32]) -> Vec<f32> {
    let network = Network::read(&model(tensors, &[does]));
    let mut network = network.expect("a network");
    network.input().copy_from_slice(input);
    network.run();
    network.result(0).to_vec()
}

/// Options of a convolution: padding, stride, activation.
fn conv(padding: u8, stride: i32, activation: u8) -> Node {
    let (stride, padding) = (Node::I32(stride), Node::U8(padding));
    Node::Table(vec![padding, stride.clone(), stride, Node::U8(activation)])
}

/// Options of a depthwise convolution, likewise.
fn depthwise(padding: u8, stride: i32, activation: u8) -> Node {
    let (stride, padding) = (Node::I32(stride), Node::U8(padding));
    let activation = Node::U8(activation);
    Node::Table(vec![
        padding,
        stride.clone(),
        stride,
        Node::I32(1),
        activation,
    ])
}

const SAME: u8 = 0;
const VALID: u8 = 1;
const NONE: u8 = 0;
const RELU6: u8 = 3;

fn counting(count: u8) -> Vec<f32> {
    (1..=count).map(f32::from).collect()
}

#[test]
fn a_convolution_of_one_pixel_mixes_channels() {
    let tensors = [
        computed(&[1, 1, 2, 2]),
        floats(&[3, 1, 1, 2], &[1.0, 0.0, 0.0, 1.0, 1.0, -1.0]),
        floats(&[3], &[0.0, 10.0, 0.5]),
        computed(&[1, 1, 2, 3]),
    ];
    let does = |activation| Does(3, conv(VALID, 1, activation), vec![0, 1, 2], 3);
    let input = counting(4);
    let wanted = [1.0, 12.0, -0.5, 3.0, 14.0, -0.5];
    assert_eq!(run(&tensors, does(NONE), &input), wanted);
    let wanted = [1.0, 6.0, 0.0, 3.0, 6.0, 0.0];
    assert_eq!(run(&tensors, does(RELU6), &input), wanted);
}

#[test]
fn what_is_negative_is_multiplied_by_the_slope_of_its_channel() {
    let tensors = |slopes: &[f32]| {
        [
            computed(&[1, 1, 2, 2]),
            floats(&[1, 1, slopes.len() as i32], slopes),
            computed(&[1, 1, 2, 2]),
        ]
    };
    let does = || Does(54, Node::Table(Vec::new()), vec![0, 1], 2);
    let wanted = [-0.5, 2.0, 3.0, 8.0];
    let input = [-1.0, 2.0, 3.0, -4.0];
    assert_eq!(run(&tensors(&[0.5, -2.0]), does(), &input), wanted);
    let network = Network::read(&model(&tensors(&[0.5, 1.0, 2.0]), &[does()]));
    let error = network.expect_err("three slopes for two channels");
    assert!(error.contains("slopes [1, 1, 3]"), "{error}");
}

#[test]
fn a_full_connection_is_a_product_with_all_numbers() {
    let tensors = [
        computed(&[1, 3]),
        floats(&[2, 3], &[1.0, 2.0, 3.0, 0.0, -1.0, 0.0]),
        floats(&[2], &[0.5, 1.0]),
        computed(&[1, 2]),
    ];
    let options = |activation| Node::Table(vec![Node::U8(activation)]);
    let does = |activation| Does(9, options(activation), vec![0, 1, 2], 3);
    assert_eq!(run(&tensors, does(NONE), &counting(3)), [14.5, -1.0]);
    assert_eq!(run(&tensors, does(RELU6), &counting(3)), [6.0, 0.0]);
}

#[test]
fn a_mean_is_over_rows_and_columns() {
    let tensors = [
        computed(&[1, 2, 2, 2]),
        ints(&[2], &[1, 2]),
        computed(&[1, 2]),
    ];
    let does = Does(40, Node::Table(vec![Node::U8(0)]), vec![0, 1], 2);
    assert_eq!(run(&tensors, does, &counting(8)), [4.0, 5.0]);
    let tensors = [
        computed(&[1, 2, 2, 2]),
        ints(&[1], &[3]),
        computed(&[1, 2, 2]),
    ];
    let does = Does(40, Node::Absent, vec![0, 1], 2);
    let error = Network::read(&model(&tensors, &[does])).expect_err("a mean over channels");
    assert!(error.contains("axes [3]"), "{error}");
}

#[test]
fn convolutions_see_zeros_beyond_the_picture() {
    let ones = [1.0; 9];
    let tensors = [
        computed(&[1, 3, 3, 1]),
        floats(&[1, 3, 3, 1], &ones),
        floats(&[1], &[0.0]),
        computed(&[1, 3, 3, 1]),
    ];
    let input = counting(9);
    let same = [12.0, 21.0, 16.0, 27.0, 45.0, 33.0, 24.0, 39.0, 28.0];
    for (code, options) in [(3, conv(SAME, 1, NONE)), (4, depthwise(SAME, 1, NONE))] {
        let out = run(&tensors, Does(code, options, vec![0, 1, 2], 3), &input);
        assert_eq!(out, same, "operator {code}");
    }
    // With a stride of 2 the corners remain; without padding, the middle.
    let out = run(
        &tensors,
        Does(3, conv(SAME, 2, NONE), vec![0, 1, 2], 3),
        &input,
    );
    assert_eq!(out, [12.0, 16.0, 24.0, 28.0]);
    let out = run(
        &tensors,
        Does(3, conv(VALID, 1, NONE), vec![0, 1, 2], 3),
        &input,
    );
    assert_eq!(out, [45.0]);
}

#[test]
fn padding_of_an_even_picture_is_at_its_end() {
    // 4 pixels at a stride of 2 need one of padding, which comes last.
    let tensors = [
        computed(&[1, 1, 4, 1]),
        floats(&[1, 1, 3, 1], &[1.0, 10.0, 100.0]),
        floats(&[1], &[0.0]),
        computed(&[1, 1, 2, 1]),
    ];
    let out = run(
        &tensors,
        Does(4, depthwise(SAME, 2, NONE), vec![0, 1, 2], 3),
        &counting(4),
    );
    assert_eq!(out, [321.0, 43.0]);
}

#[test]
fn depthwise_convolutions_keep_channels_apart() {
    // 11 channels: eight worked on together, and three.
    let weights: Vec<f32> = (0..22).map(|at| at as f32).collect();
    let bias: Vec<f32> = (0..11).map(|at| -(at as f32)).collect();
    let tensors = [
        computed(&[1, 1, 2, 11]),
        floats(&[1, 1, 2, 11], &weights),
        floats(&[11], &bias),
        computed(&[1, 1, 1, 11]),
    ];
    let input = [[1.0; 11], [2.0; 11]].concat();
    let out = run(
        &tensors,
        Does(4, depthwise(VALID, 1, NONE), vec![0, 1, 2], 3),
        &input,
    );
    let wanted: Vec<f32> = (0..11).map(|at| (at + 2 * (at + 11) - at) as f32).collect();
    assert_eq!(out, wanted);
}

#[test]
fn shapes_change_without_their_numbers() {
    let reshape = Does(22, Node::Absent, vec![0, 1], 2);
    let tensors = [
        computed(&[1, 2, 2, 4]),
        ints(&[2], &[1, -1]),
        computed(&[1, 16]),
    ];
    assert_eq!(run(&tensors, reshape, &counting(16)), counting(16));

    let block = Does(5, Node::Table(vec![Node::I32(2)]), vec![0], 1);
    let tensors = [computed(&[1, 1, 2, 4]), computed(&[1, 2, 4, 1])];
    let out = run(&tensors, block, &counting(8));
    assert_eq!(out, [1.0, 2.0, 5.0, 6.0, 3.0, 4.0, 7.0, 8.0]);

    let join = Does(2, Node::Table(vec![Node::I32(-1)]), vec![0, 0], 1);
    let tensors = [computed(&[1, 2, 1]), computed(&[1, 2, 2])];
    assert_eq!(run(&tensors, join, &counting(2)), [1.0, 1.0, 2.0, 2.0]);

    let pad = Does(34, Node::Absent, vec![0, 1], 2);
    let zeros = ints(&[4, 2], &[0, 0, 1, 0, 0, 1, 0, 1]);
    let tensors = [computed(&[1, 1, 1, 1]), zeros, computed(&[1, 2, 2, 2])];
    let out = run(&tensors, pad, &[7.0]);
    assert_eq!(out, [0.0, 0.0, 0.0, 0.0, 7.0, 0.0, 0.0, 0.0]);
}

#[test]
fn pictures_grow_between_pixel_centres() {
    let half_pixels = Node::Table(vec![Node::Absent, Node::Absent, Node::U8(0), Node::U8(1)]);
    let does = Does(23, half_pixels, vec![0, 1], 2);
    let tensors = [
        computed(&[1, 1, 2, 1]),
        ints(&[2], &[1, 4]),
        computed(&[1, 1, 4, 1]),
    ];
    assert_eq!(run(&tensors, does, &[0.0, 4.0]), [0.0, 1.0, 3.0, 4.0]);
}

#[test]
fn sums_largest_numbers_and_logistic() {
    let does = Does(0, Node::Table(vec![Node::U8(1)]), vec![0, 0], 1);
    let tensors = [computed(&[1, 3]), computed(&[1, 3])];
    assert_eq!(run(&tensors, does, &[-1.0, 0.0, 4.0]), [0.0, 0.0, 8.0]);

    let logistic = Does(14, Node::Absent, vec![0], 1);
    assert_eq!(
        run(&tensors, logistic, &[0.0, 99.0, -99.0])[..2],
        [0.5, 1.0]
    );

    let two = || Node::I32(2);
    let pool = Node::Table(vec![Node::U8(VALID), two(), two(), two(), two()]);
    let tensors = [computed(&[1, 2, 2, 2]), computed(&[1, 1, 1, 2])];
    let out = run(&tensors, Does(17, pool, vec![0], 1), &counting(8));
    assert_eq!(out, [7.0, 8.0]);
}

/// A model that unpacks weights of 16 bits, stored with zeros left out: rows [0, 1], [2, 0].
fn packed(columns: [u8; 2]) -> Vec<u8> {
    let dense = |size| Node::Table(vec![Node::U8(0), Node::I32(size)]);
    let bytes = |bytes: &[u8]| Node::Table(vec![Node::Bytes(bytes.to_vec())]);
    let sparse = vec![
        Node::U8(1),
        Node::I32(0),
        Node::U8(3),
        bytes(&[0, 1, 2]),
        Node::U8(3),
        bytes(&columns),
    ];
    let sparsity = Node::Table(vec![
        Node::Ints(vec![0, 1, 2, 3]),
        Node::Absent,
        Node::Tables(vec![dense(2), dense(1), dense(1), Node::Table(sparse)]),
    ]);
    let weights = Values(vec![2, 1, 1, 2], 1, vec![0, 0x3c, 0, 0x40], sparsity);
    let shape = [2, 1, 1, 2];
    let tensors = [
        computed(&[1, 1, 1, 2]),
        weights,
        computed(&shape),
        computed(&shape),
        floats(&[2], &[0.0, 0.0]),
        computed(&[1, 1, 1, 2]),
    ];
    model(
        &tensors,
        &[
            Does(124, Node::Absent, vec![1], 2),
            Does(6, Node::Absent, vec![2], 3),
            Does(3, conv(SAME, 1, NONE), vec![0, 3, 4], 5),
        ],
    )
}

#[test]
fn packed_weights_are_unpacked() {
    let mut network = Network::read(&packed([1, 0])).expect("a network");
    network.input().copy_from_slice(&[5.0, 7.0]);
    network.run();
    assert_eq!(network.result(0), [7.0, 10.0]);
    let error = Network::read(&packed([2, 0])).expect_err("a column beyond the shape");
    assert!(error.contains("sparse"), "{error}");
}

#[test]
fn values_that_are_still_needed_keep_their_buffers() {
    // a = relu(x + x), b = a + a, c = b + a: a lives until c.
    let tensors = vec![computed(&[1, 2]); 4];
    let add = |a, b, out| Does(0, Node::Table(vec![Node::U8(0)]), vec![a, b], out);
    let operators = [add(0, 0, 1), add(1, 1, 2), add(2, 1, 3)];
    let mut network = Network::read(&model(&tensors, &operators)).expect("a network");
    for _ in 0..2 {
        network.input().copy_from_slice(&[1.0, 10.0]);
        network.run();
        assert_eq!(network.result(0), [6.0, 60.0]);
    }
}

#[test]
fn what_is_not_supported_is_named() {
    let tensors = [computed(&[1, 2]), computed(&[1, 2])];
    let refused = |does| {
        let read = Network::read(&model(&tensors, &[does]));
        read.expect_err("not supported")
    };
    let error = refused(Does(18, Node::Absent, vec![0, 0], 1));
    assert!(error.contains("MUL"), "{error}");
    let error = refused(Does(130, Node::Absent, vec![0], 1));
    assert!(error.contains("130"), "{error}");
    let error = Network::read(b"no model at all").expect_err("no model");
    assert!(error.contains("not a TensorFlow Lite model"), "{error}");
}

#[test]
fn shapes_that_do_not_fit_are_refused() {
    let weights = |shape: &[i32], count| floats(shape, &vec![0.0; count]);
    let cases = [
        (
            vec![1, 4, 4, 3],
            weights(&[2, 1, 1, 2], 4),
            weights(&[2], 2),
        ),
        (
            vec![1, 4, 4, 2],
            weights(&[2, 1, 1, 2], 4),
            weights(&[3], 3),
        ),
        (
            vec![1, 2, 2, 2],
            weights(&[2, 3, 3, 2], 36),
            weights(&[2], 2),
        ),
        (
            vec![2, 4, 4, 2],
            weights(&[2, 1, 1, 2], 4),
            weights(&[2], 2),
        ),
        (
            vec![1, 1 << 20, 1 << 20, 2],
            weights(&[2, 1, 1, 2], 4),
            weights(&[2], 2),
        ),
        (
            vec![1, -4, 4, 2],
            weights(&[2, 1, 1, 2], 4),
            weights(&[2], 2),
        ),
    ];
    for (shape, filter, bias) in cases {
        let tensors = [computed(&shape), filter, bias, computed(&[1])];
        let does = Does(3, conv(VALID, 1, NONE), vec![0, 1, 2], 3);
        let read = Network::read(&model(&tensors, &[does]));
        assert!(read.is_err(), "{shape:?}");
    }
}

#[test]
fn damaged_models_never_run_wild() {
    let good = packed([1, 0]);
    // The last buffers are empty, so a few bytes at the end are not needed.
    for cut in 0..good.len() - 64 {
        assert!(Network::read(&good[..cut]).is_err(), "cut at {cut}");
    }
    for at in 0..good.len() {
        for value in [0, 1, 0x7f, 0xff] {
            let mut bad = good.clone();
            bad[at] = value;
            if let Ok(mut network) = Network::read(&bad) {
                network.run();
            }
        }
    }
}
