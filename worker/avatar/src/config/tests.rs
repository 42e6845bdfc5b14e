//! Names, errors and round trips of configurations.

use super::*;

#[test]
fn every_listed_tier_and_variant_exists() {
    for (tier, _) in tiers::TIERS {
        for (variant, _) in tiers::VARIANTS {
            let config = ModelConfig::named(tier, variant).expect("both are listed");
            assert_eq!(config.variant.name(), *variant, "{tier}");
        }
    }
    assert_eq!(
        ModelConfig::named("warp", "yoto"),
        Err(ConfigError::UnknownTier("warp".into()))
    );
    assert!(ModelConfig::named("fast", "x").is_err_and(|e| e.to_string().contains("humannerf")));
}

#[test]
fn configurations_of_before_there_were_bounds_leave_nothing_more_out() {
    let config = ModelConfig::named("fast", "yoto").expect("named");
    let march = config.appearance.march().expect("rays");
    assert!(march.min_transmittance > 0.0 && march.occupancy_cells > 0);
    let mut json = serde_json::to_value(&config).expect("serialises");
    let march = json["march"].as_object_mut().expect("an object");
    for field in ["min_transmittance", "occupancy_cells", "occupancy_alpha"] {
        assert!(march.remove(field).is_some(), "{field}");
    }
    let old: ModelConfig = serde_json::from_value(json).expect("reads");
    let march = old.appearance.march().expect("rays");
    assert_eq!((march.min_transmittance, march.occupancy_cells), (0.0, 0));
    let mut bad = config.clone();
    bad.appearance
        .field_mut()
        .expect("a field")
        .march
        .min_transmittance = 1.0;
    assert!(
        bad.check()
            .is_err_and(|e| e.to_string().starts_with("march.min_transmittance"))
    );
    let mut bad = config.clone();
    bad.optimise.mask_weight = -1.0;
    assert!(
        bad.check()
            .is_err_and(|e| e.to_string().starts_with("optimise.mask_weight"))
    );
    let mut bad = config;
    bad.appearance
        .field_mut()
        .expect("a field")
        .march
        .occupancy_alpha = f32::NAN;
    assert!(
        bad.check()
            .is_err_and(|e| e.to_string().starts_with("march.occupancy"))
    );
}

#[test]
fn a_persons_own_motion_weights_are_at_most_as_fine_as_the_shared_ones() {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let own = |config: &ModelConfig| config.motion.own().voxels();
    assert!(own(&config) < config.motion.resolution.voxels() / 7);
    let mut json = serde_json::to_value(&config).expect("serialises");
    let motion = json["motion"].as_object_mut().expect("an object");
    motion.remove("own").expect("the setting");
    let old: ModelConfig = serde_json::from_value(json).expect("reads");
    assert_eq!(own(&old), old.motion.resolution.voxels());
    for nodes in [[45, 44, 17], [1, 17, 7]] {
        config.motion.own = Some(Resolution::Axes(nodes));
        let error = config.check().expect_err("out of range").to_string();
        assert!(error.starts_with("motion.own"), "{error}");
    }
}

#[test]
fn a_configuration_survives_json() {
    let config = ModelConfig::named("fast", "no-identity").expect("named");
    let json = serde_json::to_string(&config).expect("serialises");
    assert_eq!(
        serde_json::from_str::<ModelConfig>(&json).expect("reads"),
        config
    );
}

#[test]
fn the_size_of_own_tables_keeps_its_form_and_other_forms_are_named() {
    let grid = |sharing: &str| {
        let json = r#"{"kind":"hash","levels":8,"base":16,"growth":1.45,"log2_rows":15,"features":2SHARING}"#;
        serde_json::from_str::<Encoding>(&json.replace("SHARING", sharing))
    };
    let split = grid(r#","sharing":{"kind":"split","own_log2_rows":11}"#).expect("today's form");
    assert!(matches!(
        split,
        Encoding::Hash {
            own_log2_rows: 11,
            ..
        }
    ));
    for (sharing, named) in [
        (r#","sharing":{"kind":"own"}"#, "own"),
        (r#","sharing":{"kind":"bases","count":4}"#, "bases"),
        ("", "sharing"),
    ] {
        let error = grid(sharing).expect_err("no such form").to_string();
        assert!(error.contains(named), "{error}");
    }
}

#[test]
fn impossible_own_tables_are_named() {
    for rows in [3, 16] {
        let mut config = ModelConfig::named("fast", "yoto").expect("named");
        if let Encoding::Hash { own_log2_rows, .. } = &mut config
            .appearance
            .field_mut()
            .expect("a field")
            .canonical
            .encoding
        {
            *own_log2_rows = rows;
        }
        let error = config.check().expect_err("impossible").to_string();
        assert!(error.contains("own_log2_rows"), "{error}");
    }
}

#[test]
fn a_code_and_the_pose_need_different_layers() {
    let mut config = ModelConfig::named("fast", "yoto").expect("named");
    config.non_rigid.layers.inject = 0;
    let error = config.check().expect_err("the pose is there").to_string();
    assert!(error.starts_with("non_rigid.layers.inject"), "{error}");
    config.variant = Variant::NoIdentity;
    assert_eq!(
        config.check(),
        Ok(()),
        "without codes, there is no conflict"
    );
}

#[test]
fn a_configuration_without_a_precision_is_f32_and_an_unknown_one_is_named() {
    let config = ModelConfig::named("fast", "yoto").expect("named");
    let json = serde_json::to_string(&config).expect("serialises");
    let named = r#""precision":"f32","#;
    assert!(json.contains(named), "{json}");
    let read = |json: String| serde_json::from_str::<ModelConfig>(&json);
    let without = read(json.replace(named, "")).expect("older checkpoints have none");
    assert_eq!(without.precision, Precision::F32);
    let half = read(json.replace(named, r#""precision":"bf16","#)).expect("reads");
    assert_eq!(half.precision, Precision::Bf16);
    let error = read(json.replace(named, r#""precision":"f8","#)).expect_err("no such one");
    assert!(error.to_string().contains("f8"), "{error}");
}

/// The configuration in a checkpoint of the tier splat of November 2026, which had a field's settings too.
#[test]
fn splats_of_a_checkpoint_with_a_fields_settings_are_read() {
    let mut config = ModelConfig::named("splat", "yoto").expect("named");
    // Models of that time have none, and as many motion weights for each person as for all.
    config.appearance.splats_mut().expect("splats").pose_shapes = PoseShapesConfig::default();
    config.motion.own = None;
    assert_eq!(config.pose_shapes(), None);
    let old = include_str!("tests/splat.json");
    let read: ModelConfig = serde_json::from_str(old).expect("reads");
    assert_eq!(read, config);
    let written = serde_json::to_value(&config).expect("serialises");
    assert!(written.get("canonical").is_none() && written.get("march").is_none());
    assert_eq!(written["splats"]["count"], 20_000);
    assert_eq!(
        serde_json::from_value::<ModelConfig>(written).expect("reads"),
        config
    );

    let other_box = old.replace("\"epsilon\": 0.001", "\"epsilon\": 0.002");
    assert_ne!(old, other_box);
    let error = serde_json::from_str::<ModelConfig>(&other_box).expect_err("another box");
    assert!(error.to_string().contains("march.epsilon"), "{error}");
}

#[test]
fn only_the_pose_condition_and_its_tier_have_pose_blend_shapes() {
    let shapes = |tier, variant| {
        let config = ModelConfig::named(tier, variant).expect("named");
        config.pose_shapes().map(|it| it.count)
    };
    for variant in ["yoto", "no-identity", "humannerf"] {
        assert_eq!(shapes("splat", variant), Some(8), "{variant}");
        assert_eq!(shapes("fast", variant), None, "{variant}");
    }
    assert_eq!(shapes("splat", "no-pose-condition"), None);
    let config = ModelConfig::named("splat", "yoto").expect("named");
    assert!(config.active_pose_shapes(0.09).is_none() && config.active_pose_shapes(0.1).is_some());
    for (setting, field) in [
        ("splats.pose_shapes.count=65", "splats.pose_shapes.count"),
        ("splats.pose_shapes.bands=0", "splats.pose_shapes.bands"),
        ("splats.pose_shapes.reach=0", "splats.pose_shapes.reach"),
        ("splats.pose_shapes.rate=-1", "splats.pose_shapes.rate"),
    ] {
        let settings = [setting.parse().expect("a setting")];
        let error = config.clone().with(&settings).expect_err(field).to_string();
        assert!(error.contains(field), "{error}");
    }
}

/// The same of the tier fast.
#[test]
fn a_field_of_a_checkpoint_is_read() {
    let config = ModelConfig::named("fast", "yoto").expect("named");
    let old: serde_json::Value =
        serde_json::from_str(include_str!("tests/fast.json")).expect("JSON");
    let read: ModelConfig = serde_json::from_value(old.clone()).expect("reads");
    assert_eq!(read, config);
    // Through text, in which single precision has few digits.
    let written = serde_json::to_string(&config).expect("serialises");
    let mut written: serde_json::Value = serde_json::from_str(&written).expect("JSON");
    // An option of earlier versions.
    written["sampling"]["harder"] = 0.0.into();
    assert_eq!(written, old);
    let mut half = old;
    half.as_object_mut().expect("an object").remove("march");
    let error = serde_json::from_value::<ModelConfig>(half).expect_err("no march");
    assert!(error.to_string().contains("canonical and march"), "{error}");
}

#[test]
fn settings_of_both_appearances_keep_their_names() {
    let set = |tier: &str, text: &str| {
        let config = ModelConfig::named(tier, "yoto").expect("named");
        config.with(&[text.parse().expect("a setting")])
    };
    let mut splats = set("splat", "splats.harmonics=2").expect("there");
    let splats = splats.appearance.splats_mut().expect("splats");
    assert_eq!(splats.harmonics, 2);
    let field = set("fast", "march.samples=32").expect("there");
    assert_eq!(field.appearance.march().expect("rays").samples, 32);
    let field = set("fast", "canonical.encoding.sharing.own_log2_rows=9").expect("there");
    assert!(matches!(
        field.appearance.encoding(),
        Some(Encoding::Hash {
            own_log2_rows: 9,
            ..
        })
    ));
    for (tier, text) in [
        ("splat", "march.samples=32"),
        ("fast", "splats.harmonics=2"),
        ("fast", "sampling.harder=1"),
    ] {
        assert!(
            set(tier, text).is_err(),
            "{tier}: {text} would mean nothing"
        );
    }
}
