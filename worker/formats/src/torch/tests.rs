//! Both forms, built byte by byte as torch writes them, and hostile ones.

use super::*;
use crate::Array;
use std::io::Write;
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

const LIMIT: u64 = 1 << 20;

fn number(value: usize) -> Vec<u8> {
    [b"J".as_slice(), &(value as i32).to_le_bytes()].concat()
}

fn text(text: &str) -> Vec<u8> {
    [
        b"X".as_slice(),
        &(text.len() as u32).to_le_bytes(),
        text.as_bytes(),
    ]
    .concat()
}

fn tuple(items: &[Vec<u8>]) -> Vec<u8> {
    [b"(".as_slice(), &items.concat(), b"t"].concat()
}

fn global(module: &str, name: &str) -> Vec<u8> {
    format!("c{module}\n{name}\n").into_bytes()
}

/// A reference to a storage of `count` floats.
fn storage(class: &str, key: &str, count: usize) -> Vec<u8> {
    let parts = [
        text("storage"),
        global("torch", class),
        text(key),
        text("cpu"),
        number(count),
    ];
    [tuple(&parts), b"Q".to_vec()].concat()
}

fn tensor(storage: &[u8], offset: usize, size: &[usize], stride: &[usize]) -> Vec<u8> {
    let lengths = |all: &[usize]| tuple(&all.iter().map(|n| number(*n)).collect::<Vec<_>>());
    let arguments = [
        storage.to_vec(),
        number(offset),
        lengths(size),
        lengths(stride),
        vec![0x89],
        [global("collections", "OrderedDict"), b")R".to_vec()].concat(),
    ];
    [
        global("torch._utils", "_rebuild_tensor_v2"),
        tuple(&arguments),
        b"R".to_vec(),
    ]
    .concat()
}

fn pickle(body: &[u8]) -> Vec<u8> {
    [b"\x80\x02", body, b"."].concat()
}

fn archive(method: CompressionMethod, entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, data) in entries {
        writer.start_file(*name, options).expect("starts");
        writer.write_all(data).expect("writes");
    }
    writer.finish().expect("finishes").into_inner()
}

fn zip_of(body: &[u8], storages: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut entries = vec![("a/data.pkl", pickle(body)), ("a/version", b"3\n".to_vec())];
    entries.extend(storages.iter().map(|(name, data)| (*name, data.clone())));
    archive(CompressionMethod::Stored, &entries)
}

fn legacy_of(body: &[u8], storages: &[(&str, usize, Vec<u8>)]) -> Vec<u8> {
    let keys: Vec<u8> = storages
        .iter()
        .flat_map(|(key, ..)| [text(key), b"a".to_vec()].concat())
        .collect();
    let mut file = [
        b"\x80\x02".as_slice(),
        MAGIC,
        b"\x80\x02M\xe9\x03.\x80\x02}.",
        &pickle(body),
        &pickle(&[b"]".to_vec(), keys].concat()),
    ]
    .concat();
    for (_, count, data) in storages {
        file.extend((*count as u64).to_le_bytes());
        file.extend(data);
    }
    file
}

fn floats(count: usize) -> Vec<u8> {
    (0..count)
        .flat_map(|at| (at as f32).to_le_bytes())
        .collect()
}

fn array(shape: &[usize], values: &[f64]) -> Value {
    Value::Array(Array {
        shape: shape.to_vec(),
        values: values.to_vec(),
    })
}

#[test]
fn tensors_are_views_of_storages_in_every_form() {
    // The columns 1 and 2 of a transposed array of 2 × 4.
    let part = tensor(&storage("FloatStorage", "0", 8), 1, &[2, 2], &[1, 4]);
    let expected = array(&[2, 2], &[1.0, 5.0, 2.0, 6.0]);
    let zip = zip_of(&part, &[("a/data/0", floats(8))]);
    assert_eq!(read(&zip, LIMIT).expect("reads"), expected);
    let legacy = legacy_of(&part, &[("0", 8, floats(8))]);
    assert_eq!(read(&legacy, LIMIT).expect("reads"), expected);
    // Inside another pickle, the bytes of a whole file hold the storage.
    let bytes = legacy_of(&storage("FloatStorage", "94", 8), &[("94", 8, floats(8))]);
    let load = [
        global("torch.storage", "_load_from_bytes"),
        tuple(&[[b"B".as_slice(), &(bytes.len() as u32).to_le_bytes(), &bytes].concat()]),
        b"R".to_vec(),
    ]
    .concat();
    let inner = pickle(&tensor(&load, 1, &[2, 2], &[1, 4]));
    assert_eq!(crate::pickle::read(&inner), Ok(expected));
}

#[test]
fn types_and_byte_orders_are_as_written() {
    let of = |class: &str, data: &[u8], order: Option<&str>| {
        let scalar = tensor(&storage(class, "k", 1), 0, &[], &[]);
        let mut storages = vec![("a/data/k", data.to_vec())];
        storages.extend(order.map(|order| ("a/byteorder", order.as_bytes().to_vec())));
        match read(&zip_of(&scalar, &storages), LIMIT).map(|value| value.numbers()) {
            Ok(Some(array)) => array.values.first().copied(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(of("LongStorage", &(-3i64).to_le_bytes(), None), Some(-3.0));
    let little = Some("little");
    assert_eq!(
        of("DoubleStorage", &0.1f64.to_le_bytes(), little),
        Some(0.1)
    );
    assert_eq!(
        of("FloatStorage", &2.5f32.to_be_bytes(), Some("big")),
        Some(2.5)
    );
    assert_eq!(of("HalfStorage", &[0x00, 0xc0], None), Some(-2.0));
    assert_eq!(of("BFloat16Storage", &[0xc0, 0xbf], None), Some(-1.5));
    assert_eq!(of("BoolStorage", &[1], None), Some(1.0));
    let scalar = tensor(&storage("IntStorage", "k", 1), 0, &[], &[]);
    let storages = [
        ("a/data/k", vec![0; 4]),
        ("a/byteorder", b"middle".to_vec()),
    ];
    let found = read(&zip_of(&scalar, &storages), LIMIT);
    assert!(matches!(found, Err(TorchError::Order)), "{found:?}");
}

#[test]
fn parameters_are_tensors_and_programs_are_refused() {
    let part = tensor(&storage("FloatStorage", "0", 2), 0, &[2], &[1]);
    let parameter = [
        global("torch._utils", "_rebuild_parameter"),
        tuple(&[part.clone(), vec![0x88], b"}".to_vec()]),
        b"R".to_vec(),
    ]
    .concat();
    let zip = zip_of(&parameter, &[("a/data/0", floats(2))]);
    assert_eq!(read(&zip, LIMIT).expect("reads"), array(&[2], &[0.0, 1.0]));
    let call = [
        global("os", "system"),
        tuple(&[text("true")]),
        b"R".to_vec(),
    ]
    .concat();
    for file in [zip_of(&call, &[]), legacy_of(&call, &[])] {
        let found = read(&file, LIMIT).expect_err("a call");
        assert!(found.to_string().contains("os.system"), "{found}");
    }
    let script = zip_of(&part, &[("a/constants.pkl", Vec::new())]);
    assert!(matches!(read(&script, LIMIT), Err(TorchError::Script)));
    // Outside a file of torch there is nothing that a reference can refer to.
    assert_eq!(
        crate::pickle::read(&pickle(&part)),
        Err(PickleError::Instruction(b'Q'))
    );
}

#[test]
fn tensors_that_exceed_their_storages_are_errors() {
    let of = |offset, size: &[usize], stride: &[usize]| {
        let part = tensor(&storage("FloatStorage", "0", 8), offset, size, stride);
        read(&zip_of(&part, &[("a/data/0", floats(8))]), LIMIT)
    };
    assert_eq!(of(8, &[0, 3], &[3, 1]).expect("empty"), array(&[0, 3], &[]));
    assert_eq!(
        of(1, &[7], &[1])
            .expect("fits")
            .numbers()
            .map(|a| a.values.len()),
        Some(7)
    );
    let hostile: [(usize, &[usize], &[usize]); 6] = [
        (2, &[7], &[1]),
        (8, &[], &[]),
        (0, &[2, 2], &[1, 8]),
        (0, &[2, 2], &[1]),
        (0, &[i32::MAX as usize; 3], &[i32::MAX as usize; 3]),
        (0, &[1; 9], &[1; 9]),
    ];
    for (offset, size, stride) in hostile {
        let found = of(offset, size, stride);
        let malformed = matches!(found, Err(TorchError::Pickle(PickleError::Malformed(_))));
        assert!(malformed, "{size:?}: {found:?}");
    }
    // A shape repeated over a clip's frames is fine; the same number a billion times is not.
    let repeated = of(0, &[3000, 8], &[0, 1]).expect("reads");
    assert_eq!(
        repeated.numbers().map(|array| array.shape),
        Some(vec![3000, 8])
    );
    for size in [vec![1 << 30], vec![1 << 21], vec![1 << 15; 8]] {
        let found = of(0, &size, &vec![0; size.len()]);
        let large = matches!(found, Err(TorchError::Pickle(PickleError::TooLarge)));
        assert!(large, "{size:?}: {found:?}");
    }
}

#[test]
fn storages_have_the_size_they_are_said_to() {
    let part = tensor(&storage("FloatStorage", "0", 8), 0, &[8], &[1]);
    for found in [7, 9] {
        let error = read(&zip_of(&part, &[("a/data/0", floats(found))]), LIMIT);
        assert!(matches!(error, Err(TorchError::Size { .. })), "{error:?}");
    }
    let error = read(&zip_of(&part, &[]), LIMIT);
    assert!(matches!(error, Err(TorchError::Archive(_))), "{error:?}");
    let two = tuple(&[part.clone(), storage("LongStorage", "0", 8)]);
    let error = read(&zip_of(&two, &[("a/data/0", floats(8))]), LIMIT);
    assert!(matches!(error, Err(TorchError::Pickle(_))), "{error:?}");
    let huge = tensor(
        &storage("FloatStorage", "0", i32::MAX as usize),
        0,
        &[1],
        &[1],
    );
    let error = read(&legacy_of(&huge, &[("0", 8, floats(8))]), LIMIT);
    let short = matches!(error, Err(TorchError::Pickle(PickleError::Truncated)));
    assert!(short, "{error:?}");
    let error = read(
        &legacy_of(&part, &[("0", 8, floats(8)), ("1", 0, vec![])]),
        LIMIT,
    );
    assert!(matches!(error, Err(TorchError::Pickle(_))), "{error:?}");
    let error = read(&legacy_of(&part, &[]), LIMIT);
    assert!(matches!(error, Err(TorchError::Pickle(_))), "{error:?}");
}

#[test]
fn broken_files_are_errors() {
    let part = tensor(&storage("FloatStorage", "0", 8), 0, &[8], &[1]);
    let legacy = legacy_of(&part, &[("0", 8, floats(8))]);
    for end in 0..legacy.len() {
        assert!(read(&legacy[..end], LIMIT).is_err(), "{end}");
    }
    for file in [&legacy, &zip_of(&part, &[("a/data/0", floats(8))])] {
        for at in 0..file.len() {
            let mut broken = file.clone();
            broken[at] ^= 0xff;
            // Any file must return.
            let _ = read(&broken, LIMIT);
        }
    }
    assert!(matches!(
        read(b"\x80\x02K\x01.", LIMIT),
        Err(TorchError::Form)
    ));
    let none = archive(CompressionMethod::Stored, &[("x", vec![1])]);
    assert!(matches!(read(&none, LIMIT), Err(TorchError::Main(0))));
    // A million lists in each other.
    let deep = zip_of(
        &[vec![b']'; 1 << 20], vec![b'a'; (1 << 20) - 1]].concat(),
        &[],
    );
    let found = read(&deep, 1 << 24);
    let large = matches!(found, Err(TorchError::Pickle(PickleError::TooLarge)));
    assert!(large, "{found:?}");
}

#[test]
fn bombs_stop_at_the_limit() {
    let part = tensor(&storage("FloatStorage", "0", 1 << 22), 0, &[1], &[1]);
    let storages = [
        ("a/data.pkl", pickle(&part)),
        ("a/data/0", vec![0; 1 << 24]),
    ];
    let bomb = archive(CompressionMethod::Deflated, &storages);
    assert!(bomb.len() < 1 << 16, "{}", bomb.len());
    assert!(matches!(read(&bomb, LIMIT), Err(TorchError::TooLarge(_))));
    assert!(read(&bomb, 1 << 25).is_ok());
}
