//! One step of the recurrence over some rows of the graph: the only place where time is spent in number crunching.

#![expect(
    unsafe_code,
    reason = "threads share values by rows, and a check of every column takes a sixth of the time of a sweep"
)]

use super::lanes::{Lane, Lanes, Vector};
use super::plan::MOST_GROUPS;
use super::schedule::{Activity, BLOCK, Schedule};
use super::seeds::Seeds;
use super::values::{SharedValues, Values};
use crate::graph::PointGraph;
use crate::{Cancel, Real, Result};
use bytemuck::Zeroable;
use multiversion::multiversion;
use multiversion::target::match_target;
use std::ops::Range;

/// Edges of a point with the paper's parameters: 10 neighbours and itself.
pub(super) const PAPER_DEGREE: usize = 11;

/// One step next <- seeds * s + initial * `z_0` + along * A z + stay * z + back * next, where `z_0` are the values that the first
/// began with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<T> {
    pub(super) seeds: T,
    pub(super) initial: T,
    pub(super) along: T,
    pub(super) stay: T,
    pub(super) back: T,
}

impl<T: Real> Step<T> {
    /// z <- A z + b as it stands.
    pub(super) fn product() -> Self {
        Self::new([1.0, 0.0], 1.0, 0.0, 0.0)
    }

    pub(super) fn new([seeds, initial]: [f64; 2], along: f64, stay: f64, back: f64) -> Self {
        let [seeds, initial] = [seeds, initial].map(T::from_f64);
        let [along, stay, back] = [along, stay, back].map(T::from_f64);
        Self {
            seeds,
            initial,
            along,
            stay,
            back,
        }
    }
}

/// Takes `steps` one after the other, each from the first of `values` to the second, which change places after it. Before the
/// first, `taken` others have been; where it began with other values than zeros, these are `initial`.
pub(super) fn take_steps<T: Lane<WIDTH>, const WIDTH: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    schedule: &Schedule,
    (taken, steps): (usize, &[Step<T>]),
    activity: &Activity,
    (initial, values): (Option<&Values<T, WIDTH>>, [&mut Values<T, WIDTH>; 2]),
    cancel: &Cancel,
) -> Result<()> {
    let values = values.map(SharedValues::new);
    schedule.run(taken..taken + steps.len(), cancel, |rows, step| {
        let step = step - taken;
        let from_to = [&values[step % 2], &values[(step + 1) % 2]];
        // SAFETY: nobody else is in these rows, and what they have edges from lies in them, in tiles next to them, which
        // neither are behind `step`, so have its z, nor ahead of the step after it, so have not lost it, or in rows that
        // take no more steps, which nobody writes
        unsafe { sweep(a, seeds, steps[step], activity, (initial, from_to), rows) }
    })
}

/// Computes the active groups of the rows in `all`, which are whole blocks, of the second values from the first, and from the
/// `initial` ones where there are any.
///
/// # Safety
/// Meanwhile nobody else touches these rows of the second values, or writes a row of the first that lies in `all` or that
/// a row in `all` has an edge from.
unsafe fn sweep<T: Lane<WIDTH>, const WIDTH: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    activity: &Activity,
    (initial, values): (Option<&Values<T, WIDTH>>, [&SharedValues<T, WIDTH>; 2]),
    all: Range<usize>,
) {
    let blocks = all.start / BLOCK..all.end.div_ceil(BLOCK);
    let rows_of = |blocks: Range<usize>| blocks.start * BLOCK..all.end.min(blocks.end * BLOCK);
    let begins = values[1].begins();
    let mut first = blocks.start;
    while first < blocks.end {
        // blocks of the same groups and common lanes take the step as one
        let (active, common) = (activity.active(first), seeds.common[first]);
        let differs =
            |&block: &usize| activity.active(block) != active || seeds.common[block] != common;
        let end = (first + 1..blocks.end).find(differs).unwrap_or(blocks.end);
        let rows = rows_of(first..end);
        // SAFETY: as the caller promises
        unsafe { step_active(a, seeds, step, (active, common), values, &rows) };
        if let Some(initial) = initial {
            for group in groups_in(active) {
                for (row, initial) in rows.clone().zip(&initial.group(group)[rows.clone()]) {
                    // SAFETY: as the caller promises
                    let next = unsafe { &mut *begins[group].add(row) };
                    (0..WIDTH).for_each(|lane| next[lane] += step.initial * initial[lane]);
                }
            }
        }
        for block in first..end {
            for (row, lane, weight) in seeds.others(block) {
                let (row, begin) = (block * BLOCK + row, begins[lane / WIDTH].cast::<T>());
                // SAFETY: as the caller promises; a seed lies in one of the rows, and in a lane of the values
                unsafe { *begin.add(row * WIDTH + lane % WIDTH) += step.seeds * weight };
            }
            // SAFETY: as the caller promises
            let rows = |group| unsafe { values[1].rows(group, &rows_of(block..block + 1)) };
            let unfilled = groups_in(active & !activity.filled(block));
            let new = unfilled.filter(|&group| in_use(rows(group)));
            activity.fill(block, new.fold(0, |bits, group| bits | 1 << group));
        }
        first = end;
    }
}

/// The groups whose bits are set.
fn groups_in(bits: u8) -> impl Iterator<Item = usize> {
    (0..MOST_GROUPS).filter(move |group| bits >> group & 1 == 1)
}

fn in_use<T: Real, const WIDTH: usize>(rows: &[Lanes<T, WIDTH>]) -> bool {
    let mut sums = [T::default(); WIDTH];
    for row in rows {
        for lane in 0..WIDTH {
            sums[lane] += row[lane].abs();
        }
    }
    sums != [T::default(); WIDTH]
}

/// Computes the groups of `rows` whose bits are set in `active`, three at a time. The lanes whose bits are set in `common` are
/// those of the rows.
///
/// # Safety
/// As of [`sweep`].
unsafe fn step_active<T: Lane<WIDTH>, const WIDTH: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    (active, common): (u8, u64),
    values: [&SharedValues<T, WIDTH>; 2],
    rows: &Range<usize>,
) {
    let mut groups = groups_in(active);
    while let Some(first) = groups.next() {
        // SAFETY: as the caller promises; groups differ
        unsafe {
            match (groups.next(), groups.next()) {
                (Some(second), Some(third)) => {
                    step_groups(a, seeds, step, common, [first, second, third], values, rows);
                }
                (Some(second), None) => {
                    step_groups(a, seeds, step, common, [first, second], values, rows);
                }
                _ => step_groups(a, seeds, step, common, [first], values, rows),
            }
        }
    }
}

/// Computes `groups` of `rows`, which share what they read of the graph.
///
/// # Safety
/// As of [`sweep`]; groups differ.
#[multiversion(targets("x86_64+avx2+fma"))]
unsafe fn step_groups<T: Lane<WIDTH>, const WIDTH: usize, const GROUPS: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    common: u64,
    groups: [usize; GROUPS],
    [z, next]: [&SharedValues<T, WIDTH>; 2],
    rows: &Range<usize>,
) {
    let values = groups.map(|group| (z.begin(group).cast_const(), next.begin(group)));
    let common = groups.map(|group| {
        let mut times = Lanes::zeroed();
        for lane in 0..WIDTH {
            if common >> (group * WIDTH + lane) & 1 == 1 {
                times[lane] = step.seeds;
            }
        }
        times
    });
    match_target! {
        // SAFETY: as the caller promises
        "x86_64+avx2+fma" => unsafe {
            step_rows::<T, WIDTH, T::Register, GROUPS>(a, seeds, step, values, &common, rows);
        },
        // SAFETY: the same
        _ => unsafe {
            step_rows::<T, WIDTH, Lanes<T, WIDTH>, GROUPS>(a, seeds, step, values, &common, rows);
        },
    }
}

/// The same with vectors of one kind. `values` says where z and next of each group begin, and `common` by how much
/// in each lane the seed is multiplied that a row has in the common ones.
///
/// # Safety
/// As of [`sweep`].
#[inline(always)]
unsafe fn step_rows<T, const WIDTH: usize, V, const GROUPS: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    values: [(*const Lanes<T, WIDTH>, *mut Lanes<T, WIDTH>); GROUPS],
    common: &[Lanes<T, WIDTH>; GROUPS],
    rows: &Range<usize>,
) where
    T: Real,
    V: Vector<T, WIDTH>,
{
    let uniform = a.degree() == Some(PAPER_DEGREE);
    let (all_columns, all_weights) = a.slices(0..a.len());
    for (i, &seed) in rows.clone().zip(&seeds.in_common[rows.clone()]) {
        let (sums, own_weight): ([V; GROUPS], T) = if uniform {
            // a number of edges known beforehand leaves no loop over them
            let start = i * PAPER_DEGREE;
            // SAFETY: as the caller promises; all rows are of this length
            unsafe {
                let (columns, weights) = (
                    all_columns.as_ptr().add(start),
                    all_weights.as_ptr().add(start),
                );
                // the first edge is to the point itself, whose values are at hand
                let others = sums(values, columns.add(1), weights.add(1), PAPER_DEGREE - 1);
                (others, *weights)
            }
        } else {
            let (columns, weights) = a.slices(i..i + 1);
            // SAFETY: as the caller promises
            let all = unsafe { sums(values, columns.as_ptr(), weights.as_ptr(), columns.len()) };
            (all, T::default())
        };
        let stay = V::splat(step.along * own_weight + step.stay);
        for group in 0..GROUPS {
            let (z, next) = values[group];
            // SAFETY: as the caller promises
            let (own, row) = unsafe { (&*z.add(i), &mut *next.add(i)) };
            // first what does not wait for the sum
            let mut value = V::zero().plus_product(stay, V::load(own));
            value = value.plus_product(V::splat(step.back), V::load(row));
            value = value.plus_product(V::splat(seed), V::load(&common[group]));
            value = value.plus_product(V::splat(step.along), sums[group]);
            value.or_zero(V::splat(seeds.least)).store(row);
        }
    }
}

/// Weighted sums, for each group, of its z at the `degree` points that `columns` name.
///
/// # Safety
/// `columns` and `weights` are those of a row of the graph, and nobody writes z at these points.
#[inline(always)]
unsafe fn sums<T: Real, const WIDTH: usize, V: Vector<T, WIDTH>, const GROUPS: usize>(
    values: [(*const Lanes<T, WIDTH>, *mut Lanes<T, WIDTH>); GROUPS],
    columns: *const u32,
    weights: *const T,
    degree: usize,
) -> [V; GROUPS] {
    // two sums of every other edge each, so that not every edge waits for the one before it
    let (mut even, mut odd) = ([V::zero(); GROUPS], [V::zero(); GROUPS]);
    let mut edge = 0;
    while edge + 1 < degree {
        // SAFETY: as the caller promises
        unsafe {
            add(&mut even, values, *columns.add(edge), *weights.add(edge));
            add(
                &mut odd,
                values,
                *columns.add(edge + 1),
                *weights.add(edge + 1),
            );
        }
        edge += 2;
    }
    if edge < degree {
        // SAFETY: as the caller promises
        unsafe { add(&mut even, values, *columns.add(edge), *weights.add(edge)) };
    }
    for group in 0..GROUPS {
        even[group] = even[group].plus(odd[group]);
    }
    even
}

/// Adds to the sum of each group what comes along one edge.
///
/// # Safety
/// `column` is a point of the graph, and nobody writes z there.
#[inline(always)]
unsafe fn add<T: Real, const WIDTH: usize, V: Vector<T, WIDTH>, const GROUPS: usize>(
    sums: &mut [V; GROUPS],
    values: [(*const Lanes<T, WIDTH>, *mut Lanes<T, WIDTH>); GROUPS],
    column: u32,
    weight: T,
) {
    let weight = V::splat(weight);
    for group in 0..GROUPS {
        // SAFETY: as the caller promises
        let z = unsafe { &*values[group].0.add(column as usize) };
        sums[group] = sums[group].plus_product(weight, V::load(z));
    }
}
