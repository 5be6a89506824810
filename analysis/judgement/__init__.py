"""A brightness track judged by several measures of loss, side by side: `evenlight judge`."""
