"""What is wrong with each photo as a whole, solved from what photos share."""
