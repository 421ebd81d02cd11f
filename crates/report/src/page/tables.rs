//! Tables that scroll by themselves where the page is narrow.

use maud::{Markup, html};

/// A table under a caption; the first column of `rows` is the header of its row, `numeric` columns
/// stand to the right.
pub struct Table<'a> {
    pub caption: &'a str,
    /// Empty where the rows need none.
    pub header: &'a [&'a str],
    /// Columns from this one on are numbers.
    pub numbers_from: usize,
    pub rows: Vec<Vec<String>>,
}

impl Table<'_> {
    pub fn html(&self) -> Markup {
        let class = |column: usize| (column >= self.numbers_from).then_some("number");
        html! {
            // Reachable by keyboard, so that it can be scrolled without a mouse.
            div.scroll role="region" tabindex="0" aria-label=(self.caption) {
                table class=[self.header.is_empty().then_some("facts")] {
                    caption { (self.caption) }
                    @if !self.header.is_empty() { thead { tr {
                        @for (column, name) in self.header.iter().enumerate() {
                            th scope="col" class=[class(column)] { (name) }
                        }
                    } } }
                    tbody {
                        @for row in &self.rows { tr {
                            @for (column, cell) in row.iter().enumerate() {
                                @if column == 0 { th scope="row" { (cell) } }
                                @else { td class=[class(column)] { (cell) } }
                            }
                        } }
                    }
                }
            }
        }
    }
}
