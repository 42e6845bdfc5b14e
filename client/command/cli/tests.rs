//! The command line parses what people type.

use super::*;
use clap::CommandFactory;

#[test]
fn the_command_line_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn every_command_and_flag_has_help() {
    let lacking = yoto_terminal::args::undocumented(&Cli::command());
    assert!(lacking.is_empty(), "{lacking:#?}");
}

#[cfg(feature = "embedded")]
#[test]
fn lpips_has_one_pair_of_variables() {
    use yoto_avatar::loss::lpips;
    use yoto_terminal::args;
    assert_eq!(args::VGG16_VARIABLE, lpips::VGG16_VARIABLE);
    assert_eq!(args::HEADS_VARIABLE, lpips::HEADS_VARIABLE);
}

#[test]
fn what_a_newcomer_types_parses() {
    let in_process = [
        "yoto serve --data d --listen 127.0.0.1:0 --no-worker",
        "yoto worker --objects file:///d/objects/ --name w",
        "yoto demo --out d --subjects 2 --size 64 --seconds 20 --seed 3",
        "yoto avatar walk.mp4 --poses wham_output.pkl --masks m --person 1 --out o --range 0..9",
        "yoto avatar walk.mp4 --pose-model models --height 1.7 --focal 1500 --refine-poses",
        "yoto avatar captures/ada --motion-file m.bvh --joint-map j.json --despite-check",
        "yoto avatar walk.mp4 --pose-model models --verbose --open",
        "yoto model erase-person checkpoints/5 --slot 2 --out checkpoints/6",
        "yoto subject export ada --out o",
        "yoto export checkpoints/5 --slot 1 --capture a --frame 3 --out ada.ply --force",
        "yoto evaluate duo --table",
        "yoto tradeoff --model duo --size 64 --views 2 --repeats 1 --out o",
        "yoto tradeoff duo --checkpoint 40 --again --out o",
        "yoto serve --listen localhost:0 --log-json",
        "yoto backup saved --data d",
        "yoto adopt --data d",
        "yoto restore saved --data d --rows-only",
        "yoto audit verify --data d --noted 1:0000000000000000000000000000000000000000000000000000000000000000",
        "yoto audit list --database postgres://yoto@db/yoto --newest 9",
        "yoto fsck --data d --objects s3://bucket/prefix --output json",
        "yoto --log-json serve",
    ];
    let everywhere = [
        "yoto capture check a",
        "yoto usage --all",
        "yoto usage --tenant lab",
        "yoto quota lab --people 50 --bytes 500G --open-jobs none --device-hours 1.5 --pictures 1000",
        "yoto capture example --people 3 --frames 40 --size 64 --out c",
        "yoto subject consent ada --for train,render --until 2027-12-31 --by father --note signed",
        "yoto subject revoke-consent ada --for render",
        "yoto subject erase ada --yes --no-wait",
        "yoto subject erasure ada --out ada.json",
        "yoto capture check a --out o --extrinsics c2w --units camera=mm --mask-shift -1",
        "yoto capture check a.zip --frames video --masks masks.mp4 --every 3",
        "yoto subject add ada --capture c --consent signed --no-wait",
        "yoto subject add ada --capture c --mirror images --k-scale 0.5 --units mm",
        "yoto subject add ada c.tar.gz --every 2 --range 10..90",
        "yoto subject add ada c --frames video --masks clean.png --timing time",
        "yoto subject add ada c --masks alpha --background scene",
        "yoto subject add ada c --frames video --mask-kind inverted --mask-shift -1",
        "yoto subject list --server http://127.0.0.1:1",
        "yoto model create duo --subjects ada,bob --tier fast --variant yoto",
        "yoto model list",
        "yoto model add-person duo cleo",
        "yoto model add-person duo cleo --seconds 30 --size 128 --preview p",
        "yoto model add-person duo cleo --refine 60",
        "yoto model add-person duo cleo --no-train",
        "yoto train duo --only cleo --steps 200",
        "yoto model remove-person duo cleo",
        "yoto train duo --seconds 60 --seed 1 --size 128",
        "yoto train duo --subjects ada,bob --steps 500 --no-wait",
        "yoto job list",
        "yoto job list --state failed,queued --limit 3 --output json",
        "yoto job show 9f31",
        "yoto status --quiet",
        "yoto model show duo --no-progress",
        "yoto subject show ada",
        "yoto subject add ada c --again",
        "yoto completions bash",
        "yoto train duo --preview p",
        "yoto render duo --subject ada --motion bob --range 10.. --follow --transparent --out o",
        "yoto render duo --scene s.json --range 10..60:2 --quality realtime --out o.mp4",
        "yoto render duo --subject ada --turntable --range ..:3 --out o.gif",
        "yoto job watch jobs/1",
        "yoto job watch",
        "yoto subject fetch ada --out o",
        "yoto subject edit ada --rename Ada --consent signed",
        "yoto job retry 9f31",
        "yoto job curve 9f31 --output json",
        "yoto job cancel 1",
        "yoto job fetch 1 --out o --force",
        "yoto model export duo --checkpoint 200 --out o",
        "yoto export duo --subject ada --capture a --capture b --out ada.html",
        "yoto export duo --subject ada --motion ada --motion bob --range 0..60:2 --out ada.glb",
        "yoto export fog --subject ada --seconds 90 --size 128 --frame 3 --out ada.spz",
        "yoto export duo --subject ada --format ply-mesh --out ada.PLY",
        "yoto export duo --subject ada --format html --out ada.html",
        "yoto export duo --subject ada --no-motion --priority high --owner me --out ada.html",
        "yoto job pause export --reason why",
        "yoto drain --wait --reason why",
        "yoto drain --end",
        "yoto worker cordon gpu-1 --reason why",
        "yoto worker uncordon gpu-1 --service http://a:1,http://b:1",
        "yoto evaluate duo",
        "yoto evaluate duo --subjects ada,bob --protocol held-out --size 128",
        "yoto evaluate duo --checkpoint 40",
        "yoto render duo --subject ada --orbit 3 --checkpoint 40 --out o",
        "yoto render duo --subject ada --orbit 3 --views 12 --out o --animate",
        "yoto render duo --subject ada --orbit 3 --max-seconds-per-frame 0.2 --out o",
        "yoto render duo --subject ada --orbit 3 --min-psnr 30 --out o",
        "yoto render duo --subject ada --orbit 3 --quality fast --out o",
        "yoto render duo --between ada,bob:0.5 --orbit 3 --out o",
        "yoto render duo --between ada,bob:0..1:10 --motion bob --out o",
        "yoto render duo --subject ada --bones bob --motion bob --out o",
        "yoto render duo --subject ada --orbit 3 --quality realtime --out o",
        "yoto render duo --subject ada --motion bob --frames 0..60:2 --out o",
        "yoto render duo --subject ada --motion bob --animate --fps 29.97 --out o --force",
        "yoto render duo --subject ada --view-list v.json --size 256 --out o",
    ];
    let in_process = in_process
        .into_iter()
        .filter(|_| cfg!(feature = "embedded"));
    for line in in_process.chain(everywhere) {
        assert!(Cli::try_parse_from(line.split(' ')).is_ok(), "{line}");
    }
}

#[test]
fn contradictions_are_refused() {
    for line in [
        "yoto avatar walk.mp4 --height 175",
        "yoto avatar walk.mp4 --focal 0",
        "yoto train duo --seconds 60 --steps 5",
        "yoto train duo --tier fast",
        "yoto train duo --only cleo --subjects cleo",
        "yoto model add-person duo cleo --no-train --seconds 30",
        "yoto model add-person duo cleo --no-train --refine 30",
        "yoto model add-person duo cleo --steps 30 --seconds 30",
        "yoto train duo --seconds -3",
        "yoto train duo --seconds inf",
        "yoto model create duo --subjects ada --tier fastest",
        "yoto render duo --subject ada --out o",
        "yoto render duo --between ada,bob --orbit 3 --out o",
        "yoto render duo --between ada,bob:0.5 --bones bob --orbit 3 --out o",
        "yoto render duo --between ada,bob:2 --orbit 3 --out o",
        "yoto render duo --between ada,bob:0.5 --subject ada --orbit 3 --out o",
        "yoto render duo --subject ada --orbit 3 --motion bob --out o",
        "yoto render duo --subject ada --orbit 3 --frames 0..9 --out o",
        "yoto demo --subjects 0",
        "yoto drain --end --wait",
        "yoto worker cordon",
        "yoto subject add ada",
        "yoto subject add ada c --capture d",
        "yoto subject add ada c --range 9..3",
        "yoto subject add ada c --every 0",
        "yoto evaluate",
        "yoto evaluate duo --protocol best",
        "yoto evaluate duo --size 8",
        "yoto tradeoff --out o",
        "yoto render duo --subject ada --orbit 3 --quality ultra --out o",
        "yoto render duo --subject ada --orbit 3 --min-psnr nan --out o",
        "yoto render duo --subject ada --orbit 3 --animate --fps 0 --out o",
        "yoto render duo --subject ada --orbit 3 --min-psnr 30 --quality fast --out o",
        "yoto export duo --subject ada --no-motion --motion bob --out ada.html",
        "yoto export duo --subject ada --seconds 0.5 --out ada.html",
        "yoto export duo --subject ada --triangles 99 --out ada.obj",
        "yoto export duo --subject ada --format gltf --out ada.glb",
    ] {
        assert!(Cli::try_parse_from(line.split(' ')).is_err(), "{line}");
    }
}

#[test]
fn deletions_and_collections_parse() {
    for line in [
        "yoto gc",
        "yoto gc --dry-run --now",
        "yoto model checkpoints duo",
        "yoto model keep duo --newest 5 --every 0",
        "yoto model delete-checkpoint duo 40",
        "yoto model delete duo",
        "yoto subject delete ada",
        "yoto subject delete-capture captures/9f31",
        "yoto job delete 9f31",
    ] {
        assert!(Cli::try_parse_from(line.split(' ')).is_ok(), "{line}");
    }
    for line in [
        "yoto model keep duo",
        "yoto model keep duo --newest 0",
        "yoto model delete-checkpoint duo best",
        "yoto model delete",
    ] {
        assert!(Cli::try_parse_from(line.split(' ')).is_err(), "{line}");
    }
}
