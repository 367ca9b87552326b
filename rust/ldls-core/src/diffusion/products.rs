//! The products z <- A z + b as they stand, one after another, with z after each of them (method, step 5).
//!
//! [`crate::diffuse`] comes to the same labels with fewer sweeps, but has no z in between. Here all labels are kept at
//! all points, in double precision: the rounding of hundreds of products then is lost in that of the single precision
//! in which likelihoods are handed out.

use super::convergence::{MOST_SWEEPS, enough};
use super::schedule::ROWS_A_TASK;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{tabulate, zeros};
use crate::{Cancel, Error, Real, Result};
use rayon::prelude::*;

/// A diffusion that is run some products at a time.
#[derive(Debug, Clone)]
pub struct Products {
    a: PointGraph,
    b: PixelLabels,
    n_labels: usize,
    /// Products to be run; without it, until one changes next to nothing.
    iterations: Option<usize>,
    /// Likelihoods after the products done: a row of `n_labels` for each point.
    z: Vec<f64>,
    /// What the next product is written to.
    next: Vec<f64>,
    done: usize,
    /// Largest change by a product after which none follows.
    enough: f64,
    converged: bool,
}

impl Products {
    /// Labels 0 to `n_labels` - 1 before the first product, from their seeds `b` over the graph `a`. `iterations` is
    /// the number of products, `None` as many as it takes.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where `b` does not fit `a` or `n_labels`, [`Error::OutOfMemory`] and [`Error::Cancelled`].
    pub fn new(
        a: PointGraph,
        b: PixelLabels,
        n_labels: usize,
        iterations: Option<usize>,
        cancel: &Cancel,
    ) -> Result<Self> {
        b.check(a.len(), n_labels)?;
        let likelihoods = a.len().saturating_mul(n_labels);
        Ok(Self {
            a,
            b,
            n_labels,
            iterations,
            next: zeros(likelihoods, cancel)?,
            z: zeros(likelihoods, cancel)?,
            done: 0,
            enough: 0.0,
            converged: false,
        })
    }

    /// Runs `products` more, or as many as there are left.
    ///
    /// # Errors
    /// [`Error::Cancelled`]: the product that it was in is not done then.
    pub fn advance(&mut self, products: usize, cancel: &Cancel) -> Result<()> {
        for _ in 0..products {
            if self.is_finished() {
                break;
            }
            self.run_product(cancel)?;
        }
        Ok(())
    }

    /// True if all products asked for are done; without a number, if the last changed no likelihood by more
    /// than 1e-5 and a hundredth of the largest seed or 20,000 are done.
    pub fn is_finished(&self) -> bool {
        match self.iterations {
            Some(iterations) => self.done >= iterations,
            None => self.converged || self.done >= MOST_SWEEPS,
        }
    }

    /// Products done.
    pub fn done(&self) -> usize {
        self.done
    }

    /// The likelihoods after the products done, row by row.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] and [`Error::Cancelled`].
    pub fn likelihoods(&self, cancel: &Cancel) -> Result<Vec<f32>> {
        tabulate(self.z.len(), |at| f32::from_f64(self.z[at]), cancel)
    }

    fn run_product(&mut self, cancel: &Cancel) -> Result<()> {
        let (a, b, z, n_labels) = (&self.a, &self.b, &self.z, self.n_labels);
        let rows = self.next.par_chunks_mut(n_labels.max(1)).enumerate();
        // one row, one thread: sums keep their order, so results do too
        rows.with_min_len(ROWS_A_TASK).try_for_each(|(i, row)| {
            cancel.check()?;
            row.fill(0.0);
            for (label, weight) in b.row(i) {
                row[label] += weight.to_f64();
            }
            for (j, weight) in a.row(i) {
                let (weight, from) = (weight.to_f64(), &z[j * n_labels..(j + 1) * n_labels]);
                row.iter_mut()
                    .zip(from)
                    .for_each(|(sum, value)| *sum += weight * value);
            }
            Ok::<(), Error>(())
        })?;
        std::mem::swap(&mut self.z, &mut self.next);
        self.done += 1;
        if self.iterations.is_none() {
            let change = self.last_change();
            if self.done == 1 {
                // the first product yields the seeds
                self.enough = enough(change);
            }
            self.converged = change <= self.enough;
        }
        Ok(())
    }

    /// Largest change of any likelihood by the last product.
    fn last_change(&self) -> f64 {
        let pairs = self.z.par_iter().zip(&self.next).with_min_len(ROWS_A_TASK);
        let changes = pairs.map(|(after, before)| (after - before).abs());
        changes.reduce(|| 0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::pair;

    fn products_of_pair(iterations: Option<usize>) -> Products {
        let (a, b) = pair();
        Products::new(a, b, 2, iterations, Cancel::never()).unwrap()
    }

    #[test]
    fn products_are_run_from_zero_one_after_another_and_no_more_than_asked_for() {
        let mut products = products_of_pair(Some(3));
        assert_eq!(products.likelihoods(Cancel::never()).unwrap(), [0.0; 4]);
        products.advance(1, Cancel::never()).unwrap();
        assert_eq!(
            products.likelihoods(Cancel::never()).unwrap(),
            [0.5, 0.0, 0.0, 0.5]
        );
        products.advance(1, Cancel::never()).unwrap();
        assert_eq!(
            products.likelihoods(Cancel::never()).unwrap(),
            [0.625, 0.125, 0.125, 0.625]
        );
        assert!(!products.is_finished());
        products.advance(5, Cancel::never()).unwrap();
        assert_eq!((products.done(), products.is_finished()), (3, true));
    }

    #[test]
    fn without_a_number_it_ends_where_a_product_changes_next_to_nothing() {
        let mut products = products_of_pair(None);
        products.advance(usize::MAX, Cancel::never()).unwrap();
        assert!(products.is_finished());
        // product t changes likelihoods by 2^-(t + 1), and 2^-17 < 1e-5 < 2^-16
        assert_eq!(products.done(), 16);
        for (value, expected) in products
            .likelihoods(Cancel::never())
            .unwrap()
            .iter()
            .zip([0.75, 0.25, 0.25, 0.75])
        {
            assert!((value - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn seeds_of_another_graph_are_refused() {
        let a = PointGraph::from_csr(vec![0, 1], vec![0], vec![1.0]).unwrap();
        let b = PixelLabels::from_csr(vec![0, 1], vec![4], vec![0.5], vec![0.5]).unwrap();
        assert!(Products::new(a.clone(), b.clone(), 4, None, Cancel::never()).is_err());
        assert!(Products::new(a, b, 5, None, Cancel::never()).is_ok());
    }
}
