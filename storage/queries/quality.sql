-- the quality of each scan: both probabilities, accepted or why not
select building, storey, scan, snapshots, incomplete,
       round(p_in, 3) as p_in, round(p_sk, 3) as p_sk, round(p_sk_worst, 3) as p_sk_worst,
       round(p_sum, 3) as p_sum, t_q, accepted, reason
-- once, however many variants and seeds read it
from (select distinct * exclude (run, variant, seed, parameters) from quality)
order by building, storey, accepted nulls first, p_sum desc, scan
