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

#[test]
fn documented_lines_parse() {
    for line in [
        "yoto-lab quality --capture a --capture b --seconds 300 --size 128 --out r.json",
        "yoto-lab quality --capture a --steps 500 --measure 6 --tier paper --out r.json",
        "yoto-lab quality --capture a --refine-poses --exposure auto --fit-poses --out r.json",
        "yoto-lab quality --capture a --refine-poses=never --output json --out r.json",
        "yoto-lab info checkpoints/5",
        "yoto-lab import-humannerf c.tar --canonical-joints j.pkl --out m",
        "yoto-lab render-frame --model m --capture a --camera cam00 --frame 3 --numerics reference --out f.npz",
        "yoto-lab render-frame --model-dir m --capture a --camera cam00 --frame 3 --out f.npz",
        "yoto-lab evaluate --model-dir d --capture a --capture b --protocol zju-step30 --table",
        "yoto-lab evaluate --model-dir d --capture a --size 64 --pictures 6",
        "yoto-lab ablation --capture a b --seconds 60 --out o",
        "yoto-lab ablation --capture a --steps 50 --measure 4 --out o",
        "yoto-lab ablation --capture a --capture b --steps 50 --tier draft --seed 3 --pictures 4 --out o",
        "yoto-lab bench --paper-step --json step.json",
        "yoto-lab bench --step fast --steps 50 --settle 200 --people 3 --size 128",
        "yoto-lab tradeoff --capture a b --tiers draft,fast --budgets 5,10.5 --size 64 --out o",
        "yoto-lab distill m --slot 1 --capture a --frames --seconds 90 --size 128 --out o",
        "yoto-lab frames m --slot 1 --size 512 --pictures 30",
        "yoto-lab stress --people 3 --steps 400 --size 256 --out stress",
        "yoto-lab stress --bodies bodies --body asian_f_1_casual white_m_1_busi --sector 45 --out stress",
        "yoto-lab stress --capture a --capture b --size 512 --out stress",
        "yoto-lab poses --bodies bodies --body asian_f_1_casual --pose-model m --out poses",
        "yoto-lab poses --capture a b --people 2 --size 768 --out poses",
        "yoto-lab body bodies --without Asian_F_1 Black_M_1 --shapes 20 --out body.safetensors",
    ] {
        assert!(Cli::try_parse_from(line.split(' ')).is_ok(), "{line}");
    }
}

#[test]
fn contradictions_are_refused() {
    for line in [
        "yoto-lab quality --out r.json",
        "yoto-lab quality --capture a --seconds 5 --steps 5 --out r.json",
        "yoto-lab quality --capture a --exposure sometimes --out r.json",
        "yoto-lab evaluate --model-dir d",
        "yoto-lab evaluate --capture a",
        "yoto-lab evaluate --model-dir d --capture a --size 8",
        "yoto-lab bench",
        "yoto-lab bench --paper-step --step fast",
        "yoto-lab bench --step fastest",
        "yoto-lab ablation --out o",
        "yoto-lab ablation --capture a --out o --seconds 5 --steps 5",
        "yoto-lab poses --out o",
        "yoto-lab poses --bodies bodies --out o",
        "yoto-lab tradeoff --out o",
        "yoto-lab tradeoff --capture a --budgets 5,-1 --out o",
        "yoto-lab tradeoff --capture a --tiers draft,ultra --out o",
        "yoto-lab distill m --capture a --seconds 0.5 --out o",
    ] {
        assert!(Cli::try_parse_from(line.split(' ')).is_err(), "{line}");
    }
}
