use super::*;

const FILE: &str = "HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 9 -5 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -40 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.008333
1 2 3 90 0 0 0 180 0
1 2 4 0 0 0 0 0 45
";

#[test]
fn a_file_is_read_whole() {
    let bvh = read(FILE).expect("reads");
    assert_eq!(bvh.joints.len(), 2);
    let leg = &bvh.joints[1];
    assert_eq!((leg.name.as_str(), leg.parent), ("Left Leg", Some(0)));
    assert_eq!(
        (leg.offset, leg.end),
        ([9.0, -5.0, 0.0], Some([0.0, -40.0, 0.0]))
    );
    assert_eq!(leg.channels[1], Channel::Rotation(0));
    assert_eq!(bvh.frames.len(), 2);
    assert_eq!(bvh.frames[0][2], 3.0);
    assert!((bvh.frames[0][3] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert!((bvh.frame_time - 0.008_333).abs() < 1e-12);
}

#[test]
fn each_fault_has_its_line() {
    let cases = [
        (
            "CHANNELS 3 Z",
            "CHANNELS 3 W",
            "line 9: 'wrotation' is not a channel",
        ),
        ("ROOT Hips", "ROOT", "line 3: a joint without a name"),
        (
            "0 0 0 0 0 45",
            "0 0 0 0 45 9 9",
            "line 20: frame 1 does not end",
        ),
        ("3 90 0 0", "3 90 0", "line 19: frame 0 does not end"),
        ("Frames: 2", "Frames: 1e30", "line 17: Frames:"),
        (
            "1 2 3 90",
            "1 2 3,5 90",
            "line 19: frame 0: '3,5' is not a number",
        ),
        ("0.008333", "0", "line 18: Frame Time"),
        ("HIERARCHY", "", "line 2: 'ROOT' instead of HIERARCHY"),
        (
            "JOINT Left Leg",
            "JOINT Left Leg { JOINT",
            "line 7: a joint without",
        ),
    ];
    for (from, to, expected) in cases {
        let error = read(&FILE.replacen(from, to, 1)).expect_err(expected);
        assert!(
            error.to_string().starts_with(expected),
            "{expected}: {error}"
        );
    }
    let first = FILE.find("180 0").expect("the first frame's end") + 4;
    for end in 0..first {
        assert!(read(&FILE[..end]).is_err(), "{end}");
    }
}

#[test]
fn what_is_there_is_read_and_what_is_not_is_said() {
    let whole = read(FILE).expect("reads");
    assert!(whole.notes.is_empty());
    let notes = |text: &str| {
        let bvh = read(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        (bvh.frames.len(), bvh.notes.join("; "))
    };
    for (counted, said) in [
        ("Frames: 1", "the header counts 1 frames, the file has 2"),
        ("Frames: 12", "the header counts 12 frames, the file has 2"),
    ] {
        let (frames, said_of_it) = notes(&FILE.replacen("Frames: 2", counted, 1));
        assert_eq!(frames, 2);
        assert!(said_of_it.contains(said), "{said_of_it}");
    }
    let (frames, said) = notes(FILE.trim_end().trim_end_matches("0 45"));
    assert_eq!(frames, 1);
    assert!(said.contains("ends within frame 1"), "{said}");
    let (frames, said) = notes(&FILE.replacen(" 45", " -", 1));
    assert_eq!(frames, 1);
    assert!(said.contains("ends within frame 1"), "{said}");
    let marked = format!(
        "\u{feff}{}",
        FILE.replace("End Site", "end site").replace('\n', "\r\n")
    );
    assert_eq!(read(&marked), Ok(whole.clone()));
    // Frames that go over several lines.
    let wrapped = FILE.replacen("3 90", "3\n90", 1).replacen("4 0", "4\n0", 1);
    assert_eq!(read(&wrapped).map(|bvh| bvh.frames), Ok(whole.frames));
    let gap = read(&FILE.replacen("1 2 3 90", "1 nan 3 90", 1)).expect("a gap");
    assert!(gap.frames[0][1].is_nan());
}
