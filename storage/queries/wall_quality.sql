-- walls by the ISPRS measures: completeness, correctness and accuracy within a buffer
select building, storey, scan, variant, buffer_m,
       bool_or(simulated) as simulated,
       count(*) as seeds,
       round(avg(true_m), 2) as true_m,
       round(avg(found_m), 2) as found_m,
       round(avg(completeness), 4) as completeness,
       round(avg(correctness), 4) as correctness,
       round(avg(accuracy_m), 4) as accuracy_m
from wall_quality
group by building, storey, scan, variant, buffer_m
order by building, storey, scan nulls first, variant, buffer_m
