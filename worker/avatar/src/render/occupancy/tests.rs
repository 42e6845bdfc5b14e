//! What the grid learns, forgets and admits.

use super::*;
use crate::config::ModelConfig;

fn grid(cells: usize) -> Occupancy {
    let tier = ModelConfig::named("draft", "yoto").expect("a tier");
    let mut config = tier.appearance.march().expect("rays").clone();
    config.occupancy_cells = cells;
    config.occupancy_alpha = 1e-2;
    let area = WarpGrid {
        min: [-1.0, 0.0, -0.25],
        max: [1.0, 1.5, 0.25],
        nodes: [8; 3],
        floor: 0.0,
    };
    Occupancy::new(&area, &config).expect("wanted")
}

/// Densities at points that nothing moves.
fn at(points: &[f32], densities: &[f32], likelihoods: &[f32]) -> DensityObservations {
    DensityObservations {
        canonical: points.to_vec(),
        moved: points.to_vec(),
        densities: densities.to_vec(),
        likelihoods: likelihoods.to_vec(),
    }
}

/// The middle of each cell, in the order of the levels.
fn middles(grid: &Occupancy) -> Vec<[f32; 3]> {
    let [nx, ny, nz] = grid.cells;
    let mut all = Vec::new();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let cell = [x, y, z];
                all.push(std::array::from_fn(|a| {
                    grid.min[a] + (cell[a] as f32 + 0.5) / grid.scale
                }));
            }
        }
    }
    all
}

#[test]
fn levels_rise_with_opacities_and_are_an_eighth_of_a_power_of_two() {
    assert_eq!((level(0.0), level(-1.0), level(f32::INFINITY)), (1, 1, 255));
    let mut last = 0;
    for i in 0..2000 {
        let alpha = 1e-7 * 1.01f32.powi(i);
        assert!(level(alpha) >= last);
        last = level(alpha);
    }
    for alpha in [1e-4f32, 3e-3, 0.07, 0.4] {
        assert_eq!(level(2.0 * alpha), level(alpha) + 8);
    }
}

#[test]
fn only_what_was_seen_to_be_empty_among_empty_neighbours_is_left_out() {
    // 70 cells: rows of bits that run over from one word into the next.
    let mut grid = grid(70);
    let all = middles(&grid);
    assert!(all.iter().all(|p| grid.admits(*p, None)), "nothing known");
    let dense = all[all.len() / 2 + 20 * 70 + 31];
    let points = all.concat();
    let densities: Vec<f32> = all
        .iter()
        .map(|p| if *p == dense { 40.0 } else { 0.0 })
        .collect();
    grid.learn(&at(&points, &densities, &vec![1.0; all.len()]));
    let near = |p: &[f32; 3]| (0..3).all(|a| (p[a] - dense[a]).abs() < 1.5 / grid.scale);
    for p in &all {
        assert_eq!(grid.admits(*p, None), near(p), "{p:?}");
    }
    let expected = 27.0 / all.len() as f64;
    assert!((grid.share() - expected).abs() < 1e-12);
    assert!(grid.admits(dense, None) && !grid.admits([f32::NAN; 3], None));
}

#[test]
fn a_density_is_forgotten_by_visits_alone_and_comes_back_at_once() {
    let mut grid = grid(12);
    let all = middles(&grid);
    let points = all.concat();
    let ones = vec![1.0; all.len()];
    grid.learn(&at(&points, &vec![30.0; all.len()], &ones));
    let steps = (0..400)
        .find(|_| {
            grid.learn(&at(&points, &vec![0.0; all.len()], &ones));
            !grid.admits(all[0], None)
        })
        .expect("it is forgotten");
    // 1 to the bound of 0.01 is six to seven powers of two, each two visits.
    assert!((11..15).contains(&steps), "{steps}");
    let before = grid.levels().to_vec();
    grid.learn(&at(&all[3], &[30.0], &[1e-3]));
    assert!(!grid.admits(all[3], None), "dense, and no part of the body");
    assert!(before != grid.levels(), "a visit leaves a trace");
    let before = grid.levels().to_vec();
    grid.learn(&at(&all[5], &[30.0], &[1.0]));
    assert!(grid.admits(all[5], None));
    let changed = before.iter().zip(grid.levels()).filter(|(a, b)| a != b);
    assert_eq!(changed.count(), 1, "cells that were not visited stay");
    grid.learn(&at(&all[7], &[f32::NAN], &[1.0]));
    assert_eq!(grid.levels()[7], before[7], "not a number says nothing");
}

#[test]
fn neither_the_order_of_samples_nor_a_copy_changes_a_bit() {
    let (mut one, mut other) = (grid(24), grid(24));
    let points: Vec<[f32; 3]> = (0..5000u64)
        .map(|i| {
            let unit = |a| scatter(3 * i + a) as f32 / u32::MAX as f32;
            [2.0 * unit(0) - 1.0, 1.5 * unit(1), 0.5 * unit(2) - 0.25]
        })
        .collect();
    let densities: Vec<f32> = (0..5000).map(|i| scatter(i) as f32 / 1e9).collect();
    let ones = vec![1.0; 5000];
    one.learn(&at(&points.concat(), &densities, &ones));
    let back: Vec<[f32; 3]> = points.into_iter().rev().collect();
    let densities: Vec<f32> = densities.into_iter().rev().collect();
    other.learn(&at(&back.concat(), &densities, &ones));
    assert_eq!(one, other);
    let copy = grid(24)
        .with_learned(one.levels(), one.reach())
        .expect("as many");
    assert_eq!(copy, one);
    assert!(grid(24).with_learned(&[0; 3], 0.0).is_none());
    assert_eq!(grid(24).with_levels_of(Some(&one)), one);
    let mut elsewhere = grid(24);
    elsewhere.min[1] += 0.01;
    let still = elsewhere.clone();
    assert_eq!(elsewhere.with_levels_of(Some(&one)), still, "another box");
    assert_eq!(grid(24).with_levels_of(None), grid(24));
}

#[test]
fn empty_cells_are_probed_in_turn() {
    let mut grid = grid(16);
    let all = middles(&grid);
    grid.learn(&at(
        &all.concat(),
        &vec![0.0; all.len()],
        &vec![1.0; all.len()],
    ));
    let admitted = |step| all.iter().filter(|p| grid.admits(**p, step)).count();
    assert_eq!(admitted(None), 0);
    let steps = 256;
    let total: usize = (0..steps).map(|step| admitted(Some(step))).sum();
    let share = total as f64 / (steps as usize * all.len()) as f64;
    assert!((share * f64::from(PROBES) - 1.0).abs() < 0.05, "{share}");
    let every = all
        .iter()
        .all(|p| (0..steps).any(|step| grid.admits(*p, Some(step))));
    assert!(every, "every cell has its turn");
}

#[test]
fn a_body_that_a_pose_moves_over_several_cells_is_not_cut() {
    let mut grid = grid(40);
    let all = middles(&grid);
    let points = all.concat();
    let body = all[all.len() / 2 + 20 * 40 + 10];
    let densities: Vec<f32> = all
        .iter()
        .map(|p| if *p == body { 40.0 } else { 0.0 })
        .collect();
    let ones = vec![1.0; all.len()];
    grid.learn(&at(&points, &densities, &ones));
    // Three and a half cells: where bones carry the samples of what is seen there in this pose.
    let offset = 3.5 / grid.scale;
    let before = [body[0] - offset, body[1], body[2]];
    assert!(!grid.admits(before, None), "nothing was ever moved");
    let mut moved = at(&before, &[40.0], &[1.0]);
    moved.moved = body.to_vec();
    let levels = grid.levels().to_vec();
    grid.learn(&moved);
    assert_eq!(levels, grid.levels(), "the body is where it was");
    assert!((grid.reach() - offset).abs() < 1e-5);
    assert!(
        grid.admits(before, None),
        "and is looked for where it may come from"
    );
    let far = [body[0] - 6.0 / grid.scale, body[1], body[2]];
    assert!(!grid.admits(far, None));
    // Another pose may move it the other way.
    assert!(grid.admits([body[0] + offset, body[1], body[2]], None));
    // Empty space may go anywhere.
    let mut empty = at(&before, &[0.0], &[1.0]);
    empty.moved = [far[0], body[1], body[2]].to_vec();
    let reach = grid.reach();
    grid.learn(&empty);
    assert_eq!(grid.reach(), reach);
}

#[test]
fn points_near_an_admitted_cell_are_near() {
    let mut grid = grid(64);
    // Everything was visited and is empty, but for one cell.
    let points = middles(&grid);
    let full = points.len() / 2;
    let mut densities = vec![0.0; points.len()];
    densities[full] = 1e3;
    let likelihoods = vec![1.0; points.len()];
    grid.learn(&at(points.as_flattened(), &densities, &likelihoods));
    let mut apart = 0;
    for point in &points {
        for axis in 0..3 {
            let mut moved = *point;
            moved[axis] += NEAR;
            let near = grid.admits_near(moved, None);
            assert!(near || !grid.admits(*point, None), "{point:?}");
        }
        apart += usize::from(!grid.admits_near(*point, None));
    }
    assert!(apart > points.len() / 2, "{apart} are far from it");
}
